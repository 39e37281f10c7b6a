"""What a layout is made for, and the application that it belongs to."""

from __future__ import annotations

import hashlib
from typing import NamedTuple

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
