"""Changes that a scenario plans itself, each before its tick."""

from __future__ import annotations

import copy
from math import ceil

from spheretwin.models.telemetry.record import Change
from spheretwin.twin.scenario.changing import from_now_on
from spheretwin.twin.scenario.sections import Scenario

# Times and periods are decimal fractions: a tick that falls on an event does so to rounding only.
ROUNDING = 1e-6


def planned(scenario: Scenario) -> tuple[Change, ...]:
    """Changes that the events of a scenario make, in the order of their times, then of the file."""
    return tuple(
        Change(
            first_tick(event.t_s / scenario.controller.period_s),
            event.set,
            from_now_on(event.set, copy.deepcopy(event.value), event.t_s),
        )
        for event in sorted(scenario.event, key=lambda event: event.t_s)
    )


def first_tick(periods: float) -> int:
    """Tick that a time, in control periods, has come at."""
    nearest = round(periods)
    return nearest if abs(periods - nearest) <= ROUNDING else ceil(periods)
