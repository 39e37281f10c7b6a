"""Tab of the modes: approach a pose, follow a shape, jog, apply manual currents, or replay a run."""

from __future__ import annotations

import time
from functools import partial
from math import degrees, pi, radians
from typing import Any, cast

import viser

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError
from spheretwin.viz.bench.event_handlers import Event, EventHandlers, Note, on_change
from spheretwin.viz.bench.protocols import BenchProtocol, Choices, FieldSetting
from spheretwin.viz.bench.scene import Scene
from spheretwin.viz.bench.settings_tab import Form

AXES = ("α", "β", "γ")

# Step of one press of an arrow key.
STEP_DEG = 1.0

FASTEST_JOG_DEG_S = 60.0

ONLY_THIS_A = 1.0

# Time that a slider which has just been moved, by a person or by the twin, is left unchanged.
UNTOUCHED_S = 0.5

NO_RUNS = "no run in the folder"

SHAPE = "trajectory.shape"


class ModesTab:
    """Tab of the modes, the keys, and the handle in the scene.

    Parameters
    ----------
    gui : viser.GuiApi
        In the tab.
    handlers : EventHandlers
        Handlers that send the commands.
    bench : BenchProtocol
        Bench with the initial state.
    choices : Choices
        Shapes and recorded runs.
    scene : Scene
        The picture.
    """

    def __init__(
        self, gui: viser.GuiApi, handlers: EventHandlers, bench: BenchProtocol, choices: Choices, scene: Scene
    ) -> None:
        self._handlers, self._bench, self._choices, self._scene = handlers, bench, choices, scene
        actuator = bench.actuator
        self._pose_rad, self._commanded_s = list(bench.state().q_ref_rad), 0.0
        self._present, self._replayed = bench.state().shape, cast("str | None", None)
        self._shape: Form
        self._point(gui, actuator, choices)
        self._follow(gui, choices)
        self._jog(gui)
        self._manual(gui, actuator)
        self._replay(gui)
        self._keys(gui)
        self._picture()

    def enter(self, event: Event, mode: str) -> None:
        """Enter a mode at the present pose, with zero rates or currents, or with the chosen run."""
        state = self._bench.state()
        groups = len(self._bench.actuator.groups)
        given = {
            "point": {"pose_rad": list(state.q_ref_rad)},
            "jog": {"rates_rad_s": [0.0, 0.0, 0.0]},
            "manual": {"currents_A": [0.0] * groups},
            "replay": {"file": self._file.value},
        }
        if mode != "replay" or self._file.value != NO_RUNS:
            self._handlers.send(event, mode, **given.get(mode, {}))
        else:
            self._handlers.show_refusal("replay: expected a recorded run in the folder, received none")

    def show(self, state: Any) -> None:
        """Update the controls while the twin is commanded elsewhere."""
        if time.monotonic() - self._commanded_s > UNTOUCHED_S:
            self._pose_rad = list(state.pose_rad or state.q_ref_rad)
        for slider, angle in zip(self._angles, self._pose_rad, strict=True):
            _follow(slider, degrees(angle))
        for limit, value in zip(self._limits, state.limits, strict=True):
            _follow(limit, value)
        rates = state.jog_rates_rad_s if state.mode == "jog" else (0.0, 0.0, 0.0)
        for slider, rate in zip(self._rates, rates, strict=True):
            _follow(slider, degrees(rate))
        currents = state.manual_currents_A if state.mode == "manual" else None
        for group, slider in enumerate(self._currents):
            _follow(slider, currents[group] if currents else 0.0)
        self._scrubber.visible = state.replay_range_s is not None
        if state.replay_range_s is not None:
            if (self._scrubber.min, self._scrubber.max) != state.replay_range_s:
                self._scrubber.min, self._scrubber.max = state.replay_range_s
            _follow(self._scrubber, state.t_s)

    def renew(self, state: Any) -> None:
        """Update the forms and lists."""
        self._pose.show(_pose_settings(self._pose_rad))
        present = next((line.text for line in self._choices.settings() if line.name == SHAPE), self._present)
        if present != self._present:  # set by a script or another page
            self._present = present
            self._shapes.options = list(dict.fromkeys([*self._choices.shapes, present]))
            self._shapes.value = present
        self._shape.show(self._choices.shape(self._shapes.value))
        runs = list(self._choices.runs())
        if state.replay_file and state.replay_file not in runs and state.replay_file != self._replayed:
            runs.append(state.replay_file)
        runs = runs or [NO_RUNS]
        if list(self._file.options) != runs:
            value = self._file.value
            self._file.options = runs
            self._file.value = value if value in runs else runs[0]
        if state.replay_file != self._replayed:
            self._replayed = state.replay_file
            if state.replay_file in runs:
                self._file.value = state.replay_file

    def _point(self, gui: viser.GuiApi, actuator: Actuator, choices: Choices) -> None:
        with gui.add_folder("point: or drag the tip, or ← ↑ ↓ →"):
            self._angles = []
            for axis, (low, high) in zip(AXES, actuator.hinge_range_rad.tolist(), strict=True):
                low, high = max(low, -pi), min(high, pi)
                self._angles.append(
                    gui.add_slider(f"{axis}, °", round(degrees(low)), round(degrees(high)), 0.1, 0.0)
                )
            note = Note(gui)
            for place, slider in enumerate(self._angles):
                on_change(slider, partial(self._on_slider, place, note))
            rate_rad_s, acceleration_rad_s2 = choices.limits
            rate = gui.add_number(
                "rate, rad/s", rate_rad_s, step=0.1, hint="largest rate of the approach to a pose"
            )
            acceleration = gui.add_number("acceleration, rad/s²", acceleration_rad_s2, step=0.1)
            self._limits = (rate, acceleration)
            limits = Note(gui)
            for name, line in (("rate_rad_s", rate), ("acceleration_rad_s2", acceleration)):
                on_change(line, partial(self._on_limit, name, limits))
            with gui.add_folder("pose as numbers", expand_by_default=False):
                self._pose = Form(gui, "Go to this pose", self._on_pose, whole=True)
            self._pose.show(_pose_settings(self._pose_rad))

    def _on_limit(self, name: str, note: Note, event: Event) -> None:
        self._handlers.send(event, "limits", note, **{name: event.target.value})

    def _on_pose(self, event: Event, fields: dict[str, str]) -> None:
        try:
            pose_rad = [radians(float(text)) for text in fields.values()]
        except ValueError:
            received = ", ".join(fields.values())
            self._handlers.show_refusal(f"expected three angles in °, received {received}", self._pose.note)
            return
        self._go(event, pose_rad, self._pose.note)

    def _on_slider(self, axis: int, note: Note, event: Event) -> None:
        self._turn(event, axis, radians(event.target.value), note)

    def _turn(self, event: Event, axis: int, angle_rad: float, note: Note | None = None) -> None:
        """Approach the pose commanded last, with one angle changed."""
        self._go(
            event, [angle_rad if index == axis else angle for index, angle in enumerate(self._pose_rad)], note
        )

    def _go(self, event: Event, pose_rad: list[float], note: Note | None = None) -> None:
        if self._handlers.send_latest(event, "point", note, pose_rad=pose_rad):
            self._pose_rad, self._commanded_s = pose_rad, time.monotonic()

    def _follow(self, gui: viser.GuiApi, choices: Choices) -> None:
        with gui.add_folder("trajectory", expand_by_default=False):
            present = self._present
            shapes = list(dict.fromkeys([*choices.shapes, present]))
            self._shapes: Any = gui.add_dropdown("shape", shapes, initial_value=present)

            def follow(event: Event, fields: dict[str, str]) -> None:
                try:
                    read = {name: choices.read(f"trajectory.{name}", text) for name, text in fields.items()}
                except InputError as error:
                    self._handlers.show_refusal(str(error), form.note)
                    return
                self._handlers.send(
                    event, "trajectory", form.note, fields={"shape": self._shapes.value, **read}
                )

            form = self._shape = Form(gui, "Follow this trajectory", follow, whole=True)
            form.show(choices.shape(present))
            on_change(self._shapes, lambda event: form.show(choices.shape(event.target.value)))

    def _jog(self, gui: viser.GuiApi) -> None:
        with gui.add_folder("jog: rates of the hinges", expand_by_default=False):
            most = FASTEST_JOG_DEG_S
            self._rates = [gui.add_slider(f"{axis}, °/s", -most, most, 1.0, 0.0) for axis in AXES]
            note = Note(gui)
            for slider in self._rates:
                self._handlers.follow(
                    slider,
                    "jog",
                    note,
                    lambda: {"rates_rad_s": [radians(rate.value) for rate in self._rates]},
                )
            self._handlers.button(gui, "Hold", "hold")

    def _manual(self, gui: viser.GuiApi, actuator: Actuator) -> None:
        groups, limit = len(actuator.groups), float(actuator.group.current_limit_A)
        with gui.add_folder("manual currents: or click a coil", expand_by_default=False):
            chosen = gui.add_slider("group", 0, groups - 1, 1, 0)
            self._handlers.button(
                gui,
                f"Only this group, at {ONLY_THIS_A:g} A",
                "manual",
                lambda: {"group": int(chosen.value), "current_A": ONLY_THIS_A},
            )
            note = Note(gui)
            with gui.add_folder("all groups", expand_by_default=False):
                self._currents = [
                    gui.add_slider(f"{group:02}, A", -limit, limit, 0.05, 0.0) for group in range(groups)
                ]
            for slider in self._currents:
                self._handlers.follow(
                    slider,
                    "manual",
                    note,
                    lambda: {"currents_A": [float(line.value) for line in self._currents]},
                )

    def _replay(self, gui: viser.GuiApi) -> None:
        with gui.add_folder("replay", expand_by_default=False):
            runs = list(self._choices.runs()) or [NO_RUNS]
            self._file: Any = gui.add_dropdown(
                "file", runs, hint="telemetry (.parquet) and recordings (.rrd) of the folder"
            )
            self._handlers.button(gui, "Replay", "replay", lambda: {"file": self._file.value})
            self._scrubber: Any = gui.add_slider("time, s", 0.0, 1.0, 0.01, 0.0, visible=False)
            self._handlers.follow(
                self._scrubber, "seek", Note(gui), lambda: {"t_s": float(self._scrubber.value)}
            )

    def _keys(self, gui: viser.GuiApi) -> None:
        for key, axis, sign in _ARROWS:
            # The hotkeys in `_ARROWS` are those of viser's literal type, which it does not export.
            command = gui.add_command(f"{AXES[axis]} {sign * STEP_DEG:+g}°", hotkey=key)  # type: ignore[arg-type]

            @command.on_trigger
            async def _(event: Event, axis: int = axis, sign: float = sign) -> None:
                self._turn(event, axis, self._pose_rad[axis] + sign * radians(STEP_DEG))

    def _picture(self) -> None:
        @self._scene.handle.on_drag
        async def _(event: Event) -> None:
            eye_m = event.client.camera.position
            self._go(event, self._scene.pose_under(event.end_position, eye_m, self._pose_rad[2]))


def _pose_settings(pose_rad: Any) -> list[FieldSetting]:
    return [
        FieldSetting(f"pose.exact {axis}, °", f"{degrees(angle):.2f}", None, f"desired angle {axis}, °")
        for axis, angle in zip(AXES, pose_rad, strict=True)
    ]


def _follow(line: Any, value: float) -> None:
    """Update a slider or a number that was not just changed, if the difference is visible."""
    if time.time() - line.update_timestamp < UNTOUCHED_S:
        return
    value = round(round(value / line.step) * line.step, 6)
    least, most = (value if bound is None else bound for bound in (line.min, line.max))
    value = min(max(value, least), most)
    if not abs(line.value - value) < line.step / 2:
        line.value = value


_ARROWS = (("arrowup", 0, -1.0), ("arrowdown", 0, 1.0), ("arrowleft", 1, -1.0), ("arrowright", 1, 1.0))
