"""Changes of a scenario, each before its tick: those that it plans itself, and those made by hand."""

from __future__ import annotations

from math import ceil

from spheretwin.models.telemetry.record import Change
from spheretwin.twin.scenario.sections import Scenario

# Times and periods are decimal fractions: a tick that falls on an event does so to rounding only.
WHOLE = 1e-9


def planned(scenario: Scenario) -> tuple[Change, ...]:
    """Changes that the events of a scenario make, in the order of their ticks, then of the file."""
    period_s = scenario.controller.period_s
    changes = [
        Change(ceil(event.t_s / period_s * (1 - WHOLE)), event.set, event.value) for event in scenario.event
    ]
    return tuple(sorted(changes, key=lambda change: change.tick))
