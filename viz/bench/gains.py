"""Gains of the law: sliders with ranges, undo, and comparison of two settings A and B."""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import numpy as np
import viser

from spheretwin.viz.bench.event_handlers import Event, on_change, on_press
from spheretwin.viz.bench.protocols import BenchProtocol, FieldSetting

SLOTS = ("A", "B")

# Changes of one gain within this time are one change to undo: a slider makes many.
TOGETHER_S = 2.0

# Time after a change of the gains that does not count in the comparison.
SETTLING_S = 1.0

# Time that a slider that was just moved is left unchanged.
UNTOUCHED_S = 1.0


class GainSliders:
    """Sliders of the gains, one for each number.

    Parameters
    ----------
    gui : viser.GuiApi
        In the tab.
    apply : callable
        Takes an event, the name of a field and its text, and sets it.
    """

    def __init__(self, gui: viser.GuiApi, apply: Any) -> None:
        self._gui, self._apply = gui, apply
        self._folder = gui.add_folder("gains")
        with self._folder:
            self._linked = gui.add_checkbox("all axes together", False, hint="a slider moves all of its gain")
        self._sliders: dict[str, list[Any]] = {}
        self._shown: tuple[Any, ...] = ()

    def show(self, settings: list[FieldSetting]) -> None:
        """Show these gains."""
        values = {setting.name: _numbers(setting.text) for setting in settings}
        ranges = {setting.name: _range(setting, values[setting.name]) for setting in settings}
        shape = tuple((name, len(numbers), ranges[name]) for name, numbers in values.items())
        if shape != self._shown:
            self._shown = shape
            self._make(values, ranges, {setting.name: setting.meaning for setting in settings})
        for name, numbers in values.items():
            for slider, number in zip(self._sliders[name], numbers, strict=True):
                untouched = time.time() - slider.update_timestamp > UNTOUCHED_S
                if untouched and not np.isclose(slider.value, number, rtol=1e-6, atol=1e-12):
                    slider.value = number

    def _make(
        self, values: dict[str, list[float]], ranges: dict[str, tuple[float, float]], hints: dict[str, str]
    ) -> None:
        for slider in (slider for sliders in self._sliders.values() for slider in sliders):
            slider.remove()
        self._sliders = {}
        with self._folder:
            for name, numbers in values.items():
                low, high = ranges[name]
                label = name.partition(".")[2]
                entries = "αβγ" if len(numbers) == 3 else [""] * len(numbers)
                self._sliders[name] = [
                    self._gui.add_slider(
                        f"{label} {entry}".strip(), low, high, (high - low) / 500, number, hint=hints[name]
                    )
                    for entry, number in zip(entries, numbers, strict=True)
                ]
                for place, slider in enumerate(self._sliders[name]):
                    on_change(slider, partial(self._moved, name, place))

    def _moved(self, name: str, place: int, event: Event) -> None:
        sliders = self._sliders.get(name, [])
        numbers = [float(slider.value) for slider in sliders]
        if self._linked.value:
            numbers = [numbers[place]] * len(numbers)
            for slider in sliders:
                slider.value = numbers[place]
        self._apply(event, name, " ".join(f"{number:.6g}" for number in numbers))


class GainHistory:
    """Undo of gains, and the comparison of two settings of them.

    Parameters
    ----------
    gui : viser.GuiApi
        In the tab.
    bench : BenchProtocol
        Bench whose error is compared.
    apply : callable
        Takes an event, the name of a field and its text, and sets it; not to be undone.
    """

    def __init__(self, gui: viser.GuiApi, bench: BenchProtocol, apply: Any) -> None:
        self._bench, self._apply = bench, apply
        self._present: dict[str, str] = {}
        self._undo: list[tuple[str, str]] = []
        self._changed = ("", 0.0)
        self._slots: dict[str, dict[str, str]] = {}
        self._squares = dict.fromkeys(SLOTS, (0.0, 0))
        self._seen, self._since_s = (-1, -1), 0.0
        on_press(gui.add_button("Undo", hint="the last change of a gain"), self._on_undo)
        compare = gui.add_button_group("compare", ("store A", "store B", "use A", "use B"))
        on_press(compare, self._on_compare)
        self._table = gui.add_html("")

    def note(self, name: str) -> None:
        """Note that a gain is about to be changed."""
        now = time.monotonic()
        last, last_s = self._changed
        if name in self._present and (name != last or now - last_s > TOGETHER_S):
            self._undo = [*self._undo[-99:], (name, self._present[name])]
        self._changed = name, now

    def show(self, settings: list[FieldSetting]) -> None:
        """Take the present gains, add the error since the last call, and show the comparison."""
        present = {setting.name: setting.text for setting in settings}
        state = self._bench.state()
        if present != self._present:
            self._present, self._since_s = present, state.t_s
        self._add_error(state.t_s)
        lines = [f"{slot}: {self._text(slot)}" for slot in SLOTS if slot in self._slots]
        content = f'<div style="padding:0 0.8em;font-size:0.85em">{"<br>".join(lines)}</div>'
        if self._table.content != content:
            self._table.content = content

    def _add_error(self, t_s: float) -> None:
        bins = self._bench.bins(self._seen[1])
        if bins.run != self._seen[0]:
            bins = self._bench.bins()
        if not bins.numbers:
            return
        self._seen = bins.run, bins.numbers[-1]
        counts = bins.rows["t_s"].reshape(-1) > self._since_s + SETTLING_S
        squares = np.sum(bins.rows["error_rad"][counts] ** 2, axis=1)
        squares = squares[np.isfinite(squares)]  # NaN: no reference applied
        for slot, gains in self._slots.items():
            if gains == self._present:
                total, count = self._squares[slot]
                self._squares[slot] = total + float(squares.sum()), count + len(squares)

    def _text(self, slot: str) -> str:
        total, count = self._squares[slot]
        used = " in use" if self._slots[slot] == self._present else ""
        if not count:
            return f"stored{used}"
        return f"RMS of |e| {1e3 * (total / count) ** 0.5:.3f} mrad over {count / 50:.0f} s{used}"

    def _on_undo(self, event: Event) -> None:
        if self._undo:
            name, text = self._undo.pop()
            self._changed = "", 0.0
            self._apply(event, name, text)

    def _on_compare(self, event: Event) -> None:
        act, _, slot = str(event.target.value).partition(" ")
        if act == "store":
            self._slots[slot] = dict(self._present)
            self._squares[slot] = 0.0, 0
        for name, text in self._slots.get(slot, {}).items() if act == "use" else ():
            if self._present.get(name) != text:
                self._apply(event, name, text)


def _numbers(text: str) -> list[float]:
    return [float(number) for number in text.split()]


def _range(setting: FieldSetting, values: list[float]) -> tuple[float, float]:
    """Return the range of the field, wider if a value is outside."""
    low, high = setting.range or (0.0, 1.0)
    while max(values) > high:
        high *= 2.0
    return min(low, *values, low), high
