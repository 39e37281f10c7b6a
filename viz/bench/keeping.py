"""The tab of what is kept: recordings, the scenario, the command line, snapshots."""

from __future__ import annotations

from typing import Any

import viser

from spheretwin.viz.bench.hand import Event, Hand, Note, on_press
from spheretwin.viz.bench.machine import Bench, Choices


class Keeping:
    """Files and snapshots.

    Parameters
    ----------
    gui : viser.GuiApi
        In the tab.
    hand : Hand
        Whom it tells.
    bench : Bench
        Whose command line is shown.
    choices : Choices
        Scenarios.
    """

    def __init__(self, gui: viser.GuiApi, hand: Hand, bench: Bench, choices: Choices) -> None:
        with gui.add_folder("record"):
            recording = gui.add_text("recording", "bench.rrd", hint="for Rerun; empty for none")
            telemetry = gui.add_text("telemetry", "bench.parquet", hint="runs again from it; empty for none")
            record = gui.add_button("Record from now on", color="red")
            for line in (recording, telemetry):
                hand.on_change(line)
            told = Note(gui, record.order + 0.5)

            def begin(event: Event) -> None:
                files = {"recording": recording.value.strip(), "telemetry": telemetry.value.strip()}
                hand.tell(event, "record", told, **{kind: file for kind, file in files.items() if file})

            on_press(record, begin)
            hand.button(gui, "End it, and complete the files", "keep")
        with gui.add_folder("scenario"):
            source = gui.add_dropdown("begin anew with", choices.scenarios)
            load = gui.add_button("Load it")
            file = gui.add_text("save as", "bench.toml")
            save = gui.add_button("Save the present settings")
            hand.on_change(source)
            hand.on_change(file)
            saved = Note(gui, save.order + 0.5)
            on_press(load, lambda event: hand.tell(event, "load", saved, source=source.value))
            on_press(save, lambda event: hand.tell(event, "save", saved, file=file.value))
        with gui.add_folder("as a command line"):
            shown: Any = gui.add_text("copy", "", multiline=True)

            def tell_line(event: Event) -> None:
                shown.value = bench.command_line()

            on_press(gui.add_button("Show it as it is now"), tell_line)
        with gui.add_folder("snapshot"):
            name = gui.add_text("name", "last")
            hand.on_change(name)
            keep = gui.add_button("Take one")
            self._kept: Any = gui.add_button_group("back to", NONE_YET, visible=False)
            note = Note(gui, self._kept.order + 0.5)
            on_press(keep, lambda event: hand.tell(event, "snapshot", note, name=name.value))

            def go_back(event: Event) -> None:
                if event.target.value in event.target.options:
                    hand.tell(event, "restore", note, name=event.target.value)

            on_press(self._kept, go_back)

    def show(self, state: Any) -> None:
        """List the snapshots."""
        if state.snapshots and tuple(self._kept.options) != state.snapshots:
            self._kept.options = state.snapshots
        if self._kept.visible != bool(state.snapshots):
            self._kept.visible = bool(state.snapshots)


# A group of buttons has to have one.
NONE_YET = ("",)
