"""What a layout is made for, and the application that it belongs to."""

from __future__ import annotations

import hashlib
from typing import NamedTuple

from spheretwin.models.telemetry.signals import Signal


class View(NamedTuple):
    """What the layout of a run's recording is made for."""

    duration_s: float
    """Length of the time axes."""
    current_limit_A: float
    """Range of the current axis."""
    groups: int
    """Coil groups, each with a current."""
    own: tuple[Signal, ...]
    """Signals that not every run has, each in a tab; the sliding variable among the plots."""
    live: bool
    """Follow the run instead of playing from its start."""


def application(view: View) -> str:
    """Application id of recordings with one layout.

    A viewer keeps one layout for each application: under a common id the second recording that it opens
    would be shown in the first one's, with its length and its tabs. Of letters, digits and dashes only, else
    the viewer changes it.
    """
    names = [(signal.name, bool(signal.states)) for signal in view.own]
    key = repr((view.duration_s, view.current_limit_A, view.groups, names, view.live))
    return f"spheretwin-{hashlib.sha256(key.encode()).hexdigest()[:12]}"
