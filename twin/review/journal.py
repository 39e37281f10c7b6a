"""Changes on the way of a run: those that its scenario planned, and what a recording tells of the others."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from spheretwin.models.telemetry.record import Change
from spheretwin.twin.scenario.changing import from_now_on
from spheretwin.twin.scenario.planned import first_tick
from spheretwin.twin.simulation import change_told
from spheretwin.viz.recording.parts.events import Event

_BETWEEN = " set to "


def planned(scenario: Mapping[str, Any], period_s: float, ticks: int) -> Iterator[Change]:
    """Changes that a scenario plans, as far as a run came."""
    for event in scenario.get("event", ()):
        if (tick := first_tick(event["t_s"] / period_s)) < ticks:
            yield Change(tick, event["set"], from_now_on(event["set"], event["value"], event["t_s"]))


def logged(
    log: Sequence[Event], scenario: Mapping[str, Any], period_s: float, ticks: int
) -> tuple[Change, ...]:
    """Changes that a log tells of and no plan; what was set without a line of the log is not among them."""
    expected = [(change.tick, change_told(change)) for change in planned(scenario, period_s, ticks)]
    found = []
    for t_s, _, text in log:
        name, between, value = text.partition(_BETWEEN)
        tick = round(t_s / period_s)
        if (tick, text) in expected:
            expected.remove((tick, text))
        elif between and all(part.isidentifier() for part in name.split(".")):
            found.append(Change(tick, name, _value(value)))
    return tuple(found)


def _value(text: str) -> Any:
    """What Python writes so, or the text itself."""
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return text
