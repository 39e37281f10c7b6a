"""Properties of a run on which its layout depends, and paths of the entities."""

from __future__ import annotations

import hashlib
from typing import NamedTuple

from spheretwin.models.telemetry.signals import COMMON_NAMES, Signal

OVERVIEW = "overview"

VIEW_NAMES = (OVERVIEW, "control", "coils", "hardware", "compare", "scenario")
"""Tabs of a recording; apart from the views, because Rerun is slow to import."""

LIVE_WINDOW_S = 10.0
"""Time before the cursor that the plots of a live view show, unless another is chosen."""

# Time after an early end that the time axes show, as a share of the time before.
AFTER_THE_END = 0.15


class View(NamedTuple):
    """Properties of a run on which its layout depends."""

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
    """Size of the actuator relative to the shipped one; the distance of the camera is proportional to it."""
    run: str = ""
    """Identity of the recording: figures of its run stand in the layout."""
    window_s: float = LIVE_WINDOW_S
    """Time before the cursor that the plots of a live view show."""
    decimated: bool = False
    """True if plots show an envelope, because the recording does not have every row."""

    @property
    def shown_s(self) -> float:
        """Length of the time that plots show at once."""
        return min(self.duration_s, self.window_s) if self.live else self.duration_s

    @property
    def names(self) -> frozenset[str]:
        """Names of all signals."""
        return COMMON_NAMES | {signal.name for signal in self.own}


def shown_until_s(duration_s: float, ended_s: float) -> float:
    """Return the end of the time axes of a run that has ended early: the end of the run is visible."""
    return min(duration_s, (1 + AFTER_THE_END) * ended_s)


def application(view: View) -> str:
    """Return the application id of recordings with one layout.

    A viewer keeps one layout for each application: with a common id the second recording that it opens
    would be shown in the first one's, with its length, its ranges and its tabs. Of letters, digits and dashes
    only, else the viewer changes it.
    """
    names = [(signal.name, bool(signal.states)) for signal in view.own]
    key = repr((*view._replace(own=()), names))
    return application_of("spheretwin", key)


def application_of(name: str, key: str) -> str:
    """Return an application id: a name and the digest of what makes a layout its own."""
    return f"{name}-{hashlib.sha256(key.encode()).hexdigest()[:12]}"


TIMELINE = "sim_time"
TELEMETRY = "telemetry"
DERIVED = "derived"
ENVELOPE = "envelope"
MARKS = "marks"
SCENARIO = "scenario"
SUMMARY = "summary"
EVENTS = "events"
RUN, LIMITS = "run", "limits"
"""Lanes of states; those of a signal of states have its name. The viewer shows paths: these are names."""
CURRENT_MAP = "currents/map"
CURRENT_RMS = "currents/rms"
PHASE_PLANE = "phase_plane"
ENDED, ONSETS = "ended", "onsets"
"""Vertical lines: the early end of a run, and below the second path the start of each fault."""


VALUES, STYLES, DESCRIBED = "values", "styles", "described"
"""Components of `TELEMETRY`: values of all signals in each row, styles of their lines, descriptions.

The first two are structs with a field a signal: each component would cost some bytes more in every row.
`DERIVED` (derived quantities of every row) and `ENVELOPE` have values and styles too; a field of an envelope
has the least values of all entries in a bin of time, then the means, then the greatest values."""

CHECKSUM, TOTAL = "checksum", "total"
"""Components of `TELEMETRY` and `EVENTS`: checksums, and how many rows or lines there are.

A checksum of the telemetry is of the rows of a chunk: number of the first, count, checksum. One of the events
is of a line: its number in the upper 32 bits, the checksum in the lower.
`CHECKSUM` also ends the names of the components that hold the checksum of a text of the same entity."""


def component(kind: str, arrival: int) -> str:
    """Return a component of the signals that arrived together: 0 at the start; a change of law brings others.

    They have separate components: viewers draw nothing of a component whose fields change.
    """
    return f"{kind}_{arrival}"
