"""Tabs of the bench's page for faults and files."""

from __future__ import annotations

from html import escape
from typing import Any

import viser

from spheretwin.viz.bench.event_handlers import Event, EventHandlers, Note, on_change, on_press
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
        detection = gui.add_checkbox("detect", False, hint="the fault detector is on")
        reported = gui.add_checkbox(
            "report to controller", False, hint="the allocation receives the fault and its group"
        )

        def retarget(event: Event) -> None:
            mode.options = list(targets[target.value]) if target.value in targets else []
            mode.value = mode.options[0] if mode.options else ""

        def fault() -> dict[str, Any]:
            fault: dict[str, Any] = {"target": target.value, "mode": mode.value}
            if value.value.strip():
                fault["value"] = choices.read("fault.0.value", value.value)
            boxes = {"detection": detection, "reported_to_controller": reported}
            return {"fault": fault | {name: True for name, box in boxes.items() if box.value}}

        on_change(target, retarget)
        handlers.button(gui, "Add from now on", "add_fault", fault, color="orange")
        self._list = gui.add_html("")
        self._shown: tuple[str, ...] | None = None
        place = gui.add_number("place", 0, min=0, step=1)
        handlers.button(
            gui, "Clear the fault at this place", "clear_faults", lambda: {"place": int(place.value)}
        )
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
        self._choices = choices
        self._scenarios: Any
        with gui.add_folder("record"):
            recording = gui.add_text("recording", "bench.rrd", hint="for Rerun; empty for none")
            telemetry = gui.add_text("telemetry", "bench.parquet", hint="can be replayed; empty for none")
            rate: Any = gui.add_dropdown(
                "rate", list(RATES), hint="rows of the recording a second, and extremes and events"
            )

            def files() -> dict[str, Any]:
                named = {"recording": recording.value.strip(), "telemetry": telemetry.value.strip()}
                given: dict[str, Any] = {kind: file for kind, file in named.items() if file}
                if (rate_Hz := RATES[rate.value]) and "recording" in given:
                    given["rate_Hz"] = rate_Hz
                return given

            handlers.button(gui, "Record from now on", "record", files, color="red")
            handlers.button(gui, "Stop and complete the files", "keep")
        with gui.add_folder("scenario"):
            source = self._scenarios = gui.add_dropdown(
                "restart with", choices.scenarios(), hint="of the package and of the folder"
            )
            handlers.button(gui, "Load", "load", lambda: {"source": source.value})
            file = gui.add_text("save as", "bench.toml")
            handlers.button(gui, "Save the present settings", "save", lambda: {"file": file.value})
        with gui.add_folder("as a command line"):
            shown: Any = gui.add_text("copy", "", multiline=True)

            def show_command_line(event: Event) -> None:
                shown.value = bench.command_line()

            on_press(gui.add_button("Show the present command line"), show_command_line)
        with gui.add_folder("snapshot"):
            name = gui.add_text("name", "last")
            handlers.button(gui, "Save a snapshot", "snapshot", lambda: {"name": name.value})
            self._snapshots: Any = gui.add_button_group("restore", NONE_YET, visible=False)
            note = Note(gui)

            def go_back(event: Event) -> None:
                if event.target.value in event.target.options:
                    handlers.send(event, "restore", note, name=event.target.value)

            on_press(self._snapshots, go_back)

    def renew(self) -> None:
        """List the scenarios of the folder."""
        scenarios = list(self._choices.scenarios())
        if list(self._scenarios.options) != scenarios:
            value = self._scenarios.value
            self._scenarios.options = scenarios
            self._scenarios.value = value if value in scenarios else scenarios[0]

    def show(self, state: Any) -> None:
        """List the snapshots."""
        if state.snapshots and tuple(self._snapshots.options) != state.snapshots:
            self._snapshots.options = state.snapshots
        if self._snapshots.visible != bool(state.snapshots):
            self._snapshots.visible = bool(state.snapshots)


# A group of buttons needs at least one button.
NONE_YET = ("",)

# Rows of a recording per second, in addition to extremes and events.
RATES: dict[str, float | None] = {
    "all rows": None,
    "500 Hz": 500.0,
    "200 Hz": 200.0,
    "60 Hz": 60.0,
    "10 Hz": 10.0,
}
