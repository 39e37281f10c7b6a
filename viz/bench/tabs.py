"""Tabs of the bench's page for faults and files, and its curves."""

from __future__ import annotations

from collections import deque
from html import escape
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.viz import theme
from spheretwin.viz.bench.event_handlers import Event, EventHandlers, Note, on_press
from spheretwin.viz.bench.protocols import BenchProtocol, Choices


class FaultsTab:
    """Tab of the faults: add, list and clear them.

    Parameters
    ----------
    gui : viser.GuiApi
        In the tab.
    handlers : EventHandlers
        Handlers that send the commands.
    choices : Choices
        Targets and modes.
    """

    def __init__(self, gui: viser.GuiApi, handlers: EventHandlers, choices: Choices) -> None:
        targets = choices.targets
        first = next(iter(targets))
        target = gui.add_dropdown("target", list(targets), initial_value=first)
        mode: Any = gui.add_dropdown("mode", list(targets[first]), initial_value=targets[first][0])
        value = gui.add_text("value", "", hint="if the mode has one")
        detection = gui.add_checkbox("detection", False, hint="the controller detects the fault itself")
        reported = gui.add_checkbox(
            "reported to controller", False, hint="the controller receives the fault and its group"
        )
        add = gui.add_button("Add from now on", color="orange")
        note = Note(gui, add.order + 0.5)

        def retarget(event: Event) -> None:
            mode.options = list(targets[target.value]) if target.value in targets else []
            mode.value = mode.options[0] if mode.options else ""

        def add_fault(event: Event) -> None:
            fault: dict[str, Any] = {"target": target.value, "mode": mode.value}
            if value.value.strip():
                try:
                    fault["value"] = choices.read("fault.0.value", value.value)
                except InputError as error:
                    handlers.show_refusal(str(error), note)
                    return
            boxes = {"detection": detection, "reported_to_controller": reported}
            fault |= {name: True for name, box in boxes.items() if box.value}
            handlers.send(event, "add_fault", note, fault=fault)

        handlers.on_change(target, retarget)
        for line in (mode, value, detection, reported):
            handlers.on_change(line)
        on_press(add, add_fault)
        self._list = gui.add_html("")
        self._shown: tuple[str, ...] | None = None
        place = gui.add_number("place", 0, min=0, step=1)
        handlers.on_change(place)
        one = gui.add_button("Clear the fault at this place")
        on_press(one, lambda event: handlers.send(event, "clear_faults", note, place=int(place.value)))
        handlers.button(gui, "Clear all", "clear_faults")

    def show(self, state: Any) -> None:
        """List the planned and active faults."""
        if state.faults != self._shown:
            self._shown = state.faults
            lines = "".join(f"<li>{escape(fault)}</li>" for fault in state.faults)
            content = (
                f'<ol start="0" style="margin:0;padding-left:1.6em">{lines}</ol>' if lines else "no faults"
            )
            self._list.content = f'<div style="padding:0.3em 0.8em;font-size:0.85em">{content}</div>'


class FilesTab:
    """Tab of files and snapshots.

    Parameters
    ----------
    gui : viser.GuiApi
        In the tab.
    handlers : EventHandlers
        Handlers that send the commands.
    bench : BenchProtocol
        Bench whose command line is shown.
    choices : Choices
        Scenarios.
    """

    def __init__(
        self, gui: viser.GuiApi, handlers: EventHandlers, bench: BenchProtocol, choices: Choices
    ) -> None:
        with gui.add_folder("record"):
            recording = gui.add_text("recording", "bench.rrd", hint="for Rerun; empty for none")
            telemetry = gui.add_text("telemetry", "bench.parquet", hint="can be replayed; empty for none")
            record = gui.add_button("Record from now on", color="red")
            for line in (recording, telemetry):
                handlers.on_change(line)
            note = Note(gui, record.order + 0.5)

            def begin(event: Event) -> None:
                files = {"recording": recording.value.strip(), "telemetry": telemetry.value.strip()}
                handlers.send(event, "record", note, **{kind: file for kind, file in files.items() if file})

            on_press(record, begin)
            handlers.button(gui, "Stop and complete the files", "keep")
        with gui.add_folder("scenario"):
            source = gui.add_dropdown("restart with", choices.scenarios)
            load = gui.add_button("Load")
            file = gui.add_text("save as", "bench.toml")
            save = gui.add_button("Save the present settings")
            handlers.on_change(source)
            handlers.on_change(file)
            saved = Note(gui, save.order + 0.5)
            on_press(load, lambda event: handlers.send(event, "load", saved, source=source.value))
            on_press(save, lambda event: handlers.send(event, "save", saved, file=file.value))
        with gui.add_folder("as a command line"):
            shown: Any = gui.add_text("copy", "", multiline=True)

            def show_command_line(event: Event) -> None:
                shown.value = bench.command_line()

            on_press(gui.add_button("Show the present command line"), show_command_line)
        with gui.add_folder("snapshot"):
            name = gui.add_text("name", "last")
            handlers.on_change(name)
            keep = gui.add_button("Save a snapshot")
            self._snapshots: Any = gui.add_button_group("restore", NONE_YET, visible=False)
            note = Note(gui, self._snapshots.order + 0.5)
            on_press(keep, lambda event: handlers.send(event, "snapshot", note, name=name.value))

            def go_back(event: Event) -> None:
                if event.target.value in event.target.options:
                    handlers.send(event, "restore", note, name=event.target.value)

            on_press(self._snapshots, go_back)

    def show(self, state: Any) -> None:
        """List the snapshots."""
        if state.snapshots and tuple(self._snapshots.options) != state.snapshots:
            self._snapshots.options = state.snapshots
        if self._snapshots.visible != bool(state.snapshots):
            self._snapshots.visible = bool(state.snapshots)


Array = NDArray[np.float64]

# A group of buttons needs at least one button.
NONE_YET = ("",)


HEIGHT = 125

# Points of a curve: what a narrow panel can show.
MOST_POINTS = 150

_INK, _LINES = "#adb5bd", "#343a40"


class CurvesPanel:
    """Curves over the last seconds.

    Parameters
    ----------
    gui : viser.GuiApi
        In the container they are to be in.
    """

    def __init__(self, gui: viser.GuiApi) -> None:
        self._error = _plot(gui, "error, mrad: bounds of all ticks", ANGLES, bounds=True)
        self._torque = _plot(gui, "command, N·m: bounds of all ticks", ANGLES, bounds=True)
        self._temperature = _plot(gui, "warmest winding, °C", ("T",))
        self._temperature.visible = False
        self._warmest: deque[tuple[float, float]] = deque(maxlen=MOST_POINTS)

    def warm(self, t_s: float, temperature_C: tuple[float, ...] | None) -> None:
        """Draw the temperature of the warmest winding, if the hardware models it."""
        if temperature_C is None:
            self._temperature.visible = False
            return
        if self._warmest and t_s <= self._warmest[-1][0]:  # another run
            self._warmest.clear()
        self._warmest.append((t_s, max(temperature_C)))
        if len(self._warmest) > 1:
            self._temperature.data = tuple(np.array(self._warmest).T.copy())
            self._temperature.visible = True

    def show(self, low: dict[str, Array], high: dict[str, Array]) -> None:
        """Draw the bounds of all ticks, as a bench has them: a band for each axis."""
        count = len(low["t_s"]) if low else 0
        if count < 2:
            return
        starts = np.arange(0, count, -(-count // MOST_POINTS))
        for plot, name, factor in ((self._error, "error_rad", 1e3), (self._torque, "torque_command_Nm", 1.0)):
            least = factor * np.minimum.reduceat(low[name], starts)
            most = factor * np.maximum.reduceat(high[name], starts)
            columns = (column for pair in zip(least.T, most.T, strict=True) for column in pair)
            plot.data = (low["t_s"][starts], *map(np.ascontiguousarray, columns))


def _plot(
    gui: viser.GuiApi, title: str, names: tuple[str, ...], *, bounds: bool = False
) -> viser.GuiUplotHandle:
    """Return a plot with a line for each name, or with two and the band between them."""
    nothing = np.array([0.0, 1.0])
    colours = ["rgb({},{},{})".format(*colour) for colour in theme.AXIS_COLOURS[: len(names)]]
    curves: Any = tuple(
        {"label": f"{name}{end}", "stroke": colour, "width": 1.0 if end else 1.5, "points": {"show": False}}
        for name, colour in zip(names, colours, strict=True)
        for end in ((" min", " max") if bounds else ("",))
    )
    bands: Any = tuple(
        {"series": (2 * place + 2, 2 * place + 1), "fill": "rgba({},{},{},0.5)".format(*colour)}
        for place, colour in enumerate(theme.AXIS_COLOURS[: len(names)])
    )
    axis = {
        "stroke": _INK,
        "grid": {"stroke": _LINES, "width": 1},
        "ticks": {"stroke": _LINES},
        "font": "10px sans-serif",
    }
    axes: Any = tuple({**axis, "size": size} for size in (32, 44))
    return gui.add_uplot(
        data=(nothing, *(np.zeros(2) for _ in curves)),
        series=({"label": "s"}, *curves),
        bands=bands if bounds else None,
        title=title,
        scales={"x": {"time": False}},
        axes=axes,
        legend={"show": True, "live": False},
        cursor={"show": False},
        height=HEIGHT,
        padding=(2, 8, 0, 0),
    )
