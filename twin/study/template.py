"""Scenarios of rows that differ in numbers alone: one text with gaps, filled and checked for each of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import chain
from math import isfinite
from typing import Any

from spheretwin.twin.scenario import reading
from spheretwin.twin.scenario.changing import check_events
from spheretwin.twin.scenario.sections import Scenario

# What no text of a scenario may hold.
MARK = "\x01"

MOST_USUAL = 2**63


class Template:
    """JSON of a scenario with a gap for each number that differs from row to row.

    To put the fields of a row together, name by name, takes longer than to check them. Where rows differ in
    numbers alone, which fields there are and what their texts say is the same in all of them. Each row is
    checked as a whole all the same.

    Parameters
    ----------
    parts : sequence of str
        Text before each gap, and behind the last.
    order : sequence of int
        Which of the values is in each gap.
    kind : type
        Of the scenario.
    source : str
        Where it comes from, for complaints.
    """

    def __init__(self, parts: Sequence[str], order: Sequence[int], kind: type[Scenario], source: str) -> None:
        self._first, *self._parts = parts
        self._order, self._kind, self._source = order, kind, source
        self._texts_are_checked = False

    def scenario(self, values: Sequence[Any]) -> Scenario:
        """Scenario with some values in the gaps.

        Raises
        ------
        InputError
            They are out of range, or do not fit each other.
        """
        filled = (self._text(values[place]) for place in self._order)
        text = self._first + "".join(chain.from_iterable(zip(filled, self._parts, strict=True)))
        scenario = reading.from_json(text, self._source, self._kind)
        if not self._texts_are_checked:
            reading.check_texts(self._source, scenario)
            self._texts_are_checked = True
        return check_events(scenario, self._source)

    def _text(self, value: float) -> str:
        """A number as JSON has it, which is as Python has it but for a few."""
        is_usual = isfinite(value) if isinstance(value, float) else abs(value) < MOST_USUAL
        return repr(value) if is_usual else reading.as_json(self._source, value).decode()


def template_of(fields: dict[str, Any], gaps: Sequence[str], source: str) -> Template | None:
    """Template of rows; None where a gap is in another one.

    Parameters
    ----------
    fields : dict
        Of one of the rows, by section, ready to be checked; changed in place.
    gaps : sequence of str
        Dotted names of what differs.
    source : str

    Raises
    ------
    InputError
        A name leads nowhere, or the fields are not as TOML has them.
    """
    kind = reading.kind_of(fields)
    for place, dotted in enumerate(gaps):
        reading.override(fields, dotted, f"{MARK}{place}{MARK}")
    text = reading.as_json(source, fields).decode()
    marks = [reading.as_json(source, f"{MARK}{place}{MARK}").decode() for place in range(len(gaps))]
    if any(text.count(mark) != 1 for mark in marks):
        return None
    order = sorted(range(len(gaps)), key=lambda place: text.index(marks[place]))
    parts = []
    for place in order:
        part, text = text.split(marks[place])
        parts.append(part)
    return Template([*parts, text], order, kind, source)


def are_numbers(values: Iterable[Any]) -> bool:
    """Whether values are such as a template has gaps for: they bring no fields of their own."""
    return all(type(value) in (float, int) for value in values)
