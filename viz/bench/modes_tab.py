"""Tab of the modes: hold, approach a pose, follow a shape, jog, or apply manual currents."""

from __future__ import annotations

import time
from functools import partial
from math import degrees, pi, radians
from typing import Any

import viser

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError
from spheretwin.viz.bench.event_handlers import Event, EventHandlers, Note, on_press
from spheretwin.viz.bench.protocols import BenchProtocol, Choices
from spheretwin.viz.bench.scene import Scene
from spheretwin.viz.bench.settings_tab import Form

AXES = ("α", "β", "γ")

# Step of one press of an arrow key.
STEP_DEG = 1.0

FASTEST_JOG_DEG_S = 60.0

ONLY_THIS_A = 1.0

# Time that a slider which has just been moved, by a person or by the twin, is left unchanged.
UNTOUCHED_S = 0.5


class ModesTab:
    """Tab of the modes, the keys, and the handles in the scene.

    Parameters
    ----------
    gui : viser.GuiApi
        In the tab.
    handlers : EventHandlers
        Handlers that send the commands.
    bench : BenchProtocol
        Bench with the initial state.
    choices : Choices
        Shapes.
    scene : Scene
        The picture.
    """

    def __init__(
        self, gui: viser.GuiApi, handlers: EventHandlers, bench: BenchProtocol, choices: Choices, scene: Scene
    ) -> None:
        self._handlers, self._bench, self._scene = handlers, bench, scene
        actuator = bench.actuator
        self._pose_rad, self._commanded_s = list(bench.state().q_ref_rad), 0.0
        modes = gui.add_button_group("mode", ("off", "hold", "trajectory"))
        on_press(modes, handlers.send_selected)
        self._point(gui, actuator, choices)
        self._follow(gui, choices)
        self._jog(gui)
        self._manual(gui, actuator)
        self._replay(gui)
        self._keys(gui)
        self._picture()

    def show(self, state: Any) -> None:
        """Update the sliders while the twin moves elsewhere."""
        if state.mode != "point" and time.monotonic() - self._commanded_s > UNTOUCHED_S:
            self._pose_rad = list(state.q_ref_rad)
        for slider, angle in zip(self._angles, self._pose_rad, strict=True):
            _follow(slider, degrees(angle))
        if state.mode != "jog":
            for slider in self._rates:
                _follow(slider, 0.0)

    def _point(self, gui: viser.GuiApi, actuator: Actuator, choices: Choices) -> None:
        with gui.add_folder("point: or drag the tip, or ← ↑ ↓ →"):
            self._angles = []
            for axis, (low, high) in zip(AXES, actuator.hinge_range_rad.tolist(), strict=True):
                low, high = max(low, -pi), min(high, pi)
                self._angles.append(
                    gui.add_slider(f"{axis}, °", round(degrees(low)), round(degrees(high)), 0.1, 0.0)
                )
            note = Note(gui, self._angles[-1].order + 0.5)
            for place, slider in enumerate(self._angles):
                self._handlers.on_change(slider, partial(self._on_slider, place, note))
            rate_rad_s, acceleration_rad_s2 = choices.limits
            rate = gui.add_number(
                "rate, rad/s", rate_rad_s, step=0.1, hint="largest rate of the approach to a pose"
            )
            acceleration = gui.add_number("acceleration, rad/s²", acceleration_rad_s2, step=1.0)
            limits = Note(gui, acceleration.order + 0.5)
            self._handlers.on_change(
                rate,
                lambda event: self._handlers.send(event, "limits", limits, rate_rad_s=event.target.value),
            )
            self._handlers.on_change(
                acceleration,
                lambda event: self._handlers.send(
                    event, "limits", limits, acceleration_rad_s2=event.target.value
                ),
            )

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
            present = self._bench.state().shape
            shapes = list(dict.fromkeys([*choices.shapes, present]))
            shape = gui.add_dropdown("shape", shapes, initial_value=present)
            form = Form(gui, self._handlers, "Follow this trajectory", whole=True)

            def follow(event: Event, fields: dict[str, str]) -> None:
                try:
                    read = {name: choices.read(f"trajectory.{name}", text) for name, text in fields.items()}
                except InputError as error:
                    self._handlers.show_refusal(str(error), form.note)
                    return
                self._handlers.send(event, "trajectory", form.note, fields={"shape": shape.value, **read})

            form.on_apply(follow)
            form.show(choices.shape(present))
            self._handlers.on_change(shape, lambda event: form.show(choices.shape(event.target.value)))

    def _jog(self, gui: viser.GuiApi) -> None:
        with gui.add_folder("jog: rates of the hinges", expand_by_default=False):
            most = FASTEST_JOG_DEG_S
            self._rates = [gui.add_slider(f"{axis}, °/s", -most, most, 1.0, 0.0) for axis in AXES]
            note = Note(gui, self._rates[-1].order + 0.5)
            for slider in self._rates:
                self._handlers.on_change(
                    slider,
                    lambda event: self._handlers.send_latest(
                        event, "jog", note, rates_rad_s=[radians(rate.value) for rate in self._rates]
                    ),
                )
            self._handlers.button(gui, "Hold", "hold")

    def _manual(self, gui: viser.GuiApi, actuator: Actuator) -> None:
        groups, limit = len(actuator.groups), float(actuator.group.current_limit_A)
        with gui.add_folder("manual currents", expand_by_default=False):
            gui.add_markdown("In this mode, click a coil to apply a current to its group only.")
            chosen = gui.add_slider("group", 0, groups - 1, 1, 0)
            self._handlers.on_change(chosen)
            alone = gui.add_button(f"Only this group, at {ONLY_THIS_A:g} A")
            note = Note(gui, alone.order + 0.5)
            on_press(
                alone,
                lambda event: self._handlers.send(
                    event, "manual", note, group=int(chosen.value), current_A=ONLY_THIS_A
                ),
            )
            with gui.add_folder("all groups", expand_by_default=False):
                sliders = [
                    gui.add_slider(f"{group:02}, A", -limit, limit, 0.05, 0.0) for group in range(groups)
                ]
            for slider in sliders:
                self._handlers.on_change(
                    slider,
                    lambda event: self._handlers.send_latest(
                        event, "manual", note, currents_A=[float(current.value) for current in sliders]
                    ),
                )

    def _replay(self, gui: viser.GuiApi) -> None:
        with gui.add_folder("replay", expand_by_default=False):
            file = gui.add_text("file", "", hint="telemetry (.parquet) or recording (.rrd) on this machine")
            self._handlers.on_change(file)
            play = gui.add_button("Replay")
            note = Note(gui, play.order + 0.5)
            on_press(play, lambda event: self._handlers.send(event, "replay", note, file=file.value))

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

        @self._scene.coils.on_click
        async def _(event: Event) -> None:
            state = self._bench.state()
            group = self._scene.group_of(event.instance_index)
            if state.mode == "manual" and group is not None:
                self._handlers.send(event, "manual", group=group, current_A=ONLY_THIS_A)


def _follow(slider: Any, value: float) -> None:
    """Update a slider that was not just moved, if the change is visible."""
    if time.time() - slider.update_timestamp < UNTOUCHED_S:
        return
    value = min(max(round(value, 1), slider.min), slider.max)
    if not abs(slider.value - value) < slider.step / 2:
        slider.value = value


_ARROWS = (("arrowup", 0, -1.0), ("arrowdown", 0, 1.0), ("arrowleft", 1, -1.0), ("arrowright", 1, 1.0))
