"""Template of a scenario: the scenarios of runs that differ in numbers alone."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import Any

from pydantic_core import to_json

from spheretwin.scenario import reading
from spheretwin.scenario.changes import check_events
from spheretwin.scenario.sections import Scenario

# Character that no text of a scenario contains.
MARK = "\x01"

MOST_USUAL = 2.0**63


class Template:
    """JSON of a scenario with a gap for each number that differs from row to row.

    Merging the fields of a row takes longer than validating them. If rows differ in numbers alone, everything
    else is the same in all of them. Each row is validated completely all the same.

    Parameters
    ----------
    parts : sequence of str
        Text before each gap, and behind the last.
    order : sequence of int
        Index of the value of each gap.
    own : set of str
        Sections with a gap. All scenarios share the other ones, which also need no second set-up.
    kind : type
        Of the scenario.
    source : str
        Its origin, for messages.
    """

    def __init__(
        self, parts: Sequence[str], order: Sequence[int], own: set[str], kind: type[Scenario], source: str
    ) -> None:
        self._first, *self._parts = parts
        self._order, self._kind, self._source = order, kind, source
        self._shared: dict[str, Any] | None = None
        self._own = own

    def scenario(self, values: Sequence[Any]) -> Scenario:
        """Scenario with some values in the gaps.

        Raises
        ------
        InputError
            They are out of range, or do not fit each other.
        """
        numbers = self._texts(values)
        filled = [numbers[place] for place in self._order]
        text = self._first + "".join(chain.from_iterable(zip(filled, self._parts, strict=True)))
        scenario = reading.from_json(text, self._source, self._kind)
        if self._shared is None:
            reading.check_texts(self._source, scenario)
            self._shared = {name: section for name, section in scenario if name not in self._own}
        return check_events(scenario.model_copy(update=self._shared), self._source)

    def _texts(self, values: Sequence[Any]) -> list[str]:
        """Return the numbers as JSON texts."""
        if all(abs(value) < MOST_USUAL for value in values):  # neither NaN nor infinity
            return to_json(values).decode()[1:-1].split(",")
        return [reading.as_json(self._source, value).decode() for value in values]


def template_of(fields: dict[str, Any], gaps: Sequence[str], source: str) -> Template | None:
    """Template of rows; None if a gap is in another one.

    Parameters
    ----------
    fields : dict
        Fields of one row by section, not validated; changed in place.
    gaps : sequence of str
        Dotted names of the differing fields.
    source : str

    Raises
    ------
    InputError
        A name is of no field, or the fields are not valid TOML values.
    """
    kind = reading.scenario_type(fields)
    for place, dotted in enumerate(gaps):
        reading.override(fields, dotted, f"{MARK}{place}{MARK}")
    text = reading.as_json(source, fields).decode()
    marks = [reading.as_json(source, f"{MARK}{place}{MARK}").decode() for place in range(len(gaps))]
    if any(text.count(mark) != 1 for mark in marks):
        return None
    order = sorted(range(len(gaps)), key=lambda place: text.index(marks[place]))
    own = {dotted.partition(".")[0] for dotted in gaps}
    parts = []
    for place in order:
        part, text = text.split(marks[place])
        parts.append(part)
    return Template([*parts, text], order, own, kind, source)


def is_number(value: Any) -> bool:
    """True if a value is a number, for which a template has a gap."""
    return type(value) in (float, int)
