"""The tab of the faults: add one, see them, take them back."""

from __future__ import annotations

from html import escape
from typing import Any

import viser

from spheretwin.models.base.errors import InputError
from spheretwin.viz.bench.hand import Event, Hand, Note, on_press
from spheretwin.viz.bench.machine import Choices


class Faults:
    """What fails, from now on.

    Parameters
    ----------
    gui : viser.GuiApi
        In the tab.
    hand : Hand
        Whom it tells.
    choices : Choices
        Targets and modes.
    """

    def __init__(self, gui: viser.GuiApi, hand: Hand, choices: Choices) -> None:
        targets = choices.targets
        first = next(iter(targets))
        target = gui.add_dropdown("target", list(targets), initial_value=first)
        mode: Any = gui.add_dropdown("mode", list(targets[first]), initial_value=targets[first][0])
        value = gui.add_text("value", "", hint="where the mode has one")
        detect = gui.add_checkbox("look for it", False, hint="the controller looks for it by itself")
        known = gui.add_checkbox("told of it", False, hint="the controller is told")
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
                    hand.complain(str(error), note)
                    return
            fault |= {name: True for name, box in (("detect", detect), ("known", known)) if box.value}
            hand.tell(event, "add_fault", note, fault=fault)

        hand.on_change(target, retarget)
        for line in (mode, value, detect, known):
            hand.on_change(line)
        on_press(add, add_fault)
        self._list = gui.add_html("")
        self._shown: tuple[str, ...] | None = None
        place = gui.add_number("place", 0, min=0, step=1)
        hand.on_change(place)
        one = gui.add_button("Clear the one at this place")
        on_press(one, lambda event: hand.tell(event, "clear_faults", note, place=int(place.value)))
        hand.button(gui, "Clear all", "clear_faults")

    def show(self, state: Any) -> None:
        """List what is planned or at work."""
        if state.faults != self._shown:
            self._shown = state.faults
            lines = "".join(f"<li>{escape(fault)}</li>" for fault in state.faults)
            told = f'<ol start="0" style="margin:0;padding-left:1.6em">{lines}</ol>' if lines else "no faults"
            self._list.content = f'<div style="padding:0.3em 0.8em;font-size:0.85em">{told}</div>'
