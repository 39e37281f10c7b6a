"""What a layout is made for, and the application that it belongs to."""

from __future__ import annotations

import hashlib
from typing import NamedTuple

import rerun as rr

from spheretwin.models.telemetry.signals import COMMON_NAMES, Signal

OVERVIEW = "overview"

VIEW_NAMES = (OVERVIEW, "control", "coils", "hardware", "compare", "scenario")
"""What a recording has in tabs; kept apart from the views, for Rerun is slow to import."""

# Of the time until a run has ended early, what the time axes show behind it.
AFTER_THE_END = 0.15


class View(NamedTuple):
    """What the layout of a run's recording is made for."""

    duration_s: float
    """Length of the time axes."""
    current_limit_A: float
    """Range of the current axis."""
    groups: int
    """Coil groups, each with a current."""
    own: tuple[Signal, ...]
    """Signals that not every run has."""
    live: bool
    """Follow the run instead of playing from its start."""
    shown: str = OVERVIEW
    """The view that is open at first."""
    size: float = 1.0
    """Of the actuator, beside the shipped one; the eye stands as many times as far."""
    run: str = ""
    """What tells the recording from others, for figures of its run stand in the layout."""

    @property
    def names(self) -> frozenset[str]:
        """Names of all signals."""
        return COMMON_NAMES | {signal.name for signal in self.own}


def shown_until_s(duration_s: float, ended_s: float) -> float:
    """End of the time axes of a run that has ended early: so that one sees that it has, and where."""
    return min(duration_s, (1 + AFTER_THE_END) * ended_s)


def application(view: View) -> str:
    """Application id of recordings with one layout.

    A viewer keeps one layout for each application: under a common id the second recording that it opens
    would be shown in the first one's, with its length, its ranges and its tabs. Of letters, digits and dashes
    only, else the viewer changes it.
    """
    names = [(signal.name, bool(signal.states)) for signal in view.own]
    key = repr((*view._replace(own=()), names))
    return f"spheretwin-{hashlib.sha256(key.encode()).hexdigest()[:12]}"


TIMELINE = "sim_time"
TELEMETRY = "telemetry"
DERIVED = "derived"
SCENARIO = "scenario"
SUMMARY = "summary"
EVENTS = "events"
STATES = "states"
CURRENT_MAP = "currents/map"
CURRENT_BARS = "currents/bars"
CURRENT_BARS_STILL = f"{CURRENT_BARS}/still"
PHASE_PLANE = "phase_plane"
ENDED = "ended"


VALUES, STYLES, DESCRIBED = "values", "styles", "described"
"""Components of `TELEMETRY`: what all signals are in each row, how their lines look, what they are.

The first two are structs with a field a signal: each component would cost some bytes more in every row."""

CHECKSUM, TOTAL = "checksum", "total"
"""Components of `TELEMETRY` and `EVENTS`: checksums, and how many rows or lines there are.

A checksum of the telemetry is of the rows of a chunk: number of the first, count, checksum. One of the events
is of a line: its number in the upper 32 bits, the checksum in the lower.
`CHECKSUM` also ends the names of the components that hold the checksum of a text of the same entity."""


def component(kind: str, arrival: int) -> str:
    """Component of the signals that came together: 0 for those of the start; a change of law brings others.

    They have components of their own: of one whose fields change, viewers draw nothing.
    """
    return f"{kind}_{arrival}"


def derived(quantity: str) -> str:
    """Entity that holds a derived quantity."""
    return f"{DERIVED}/{rr.escape_entity_path_part(quantity)}"
