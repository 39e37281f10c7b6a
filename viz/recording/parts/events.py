"""What is worth a line in a run's log: saturation, and how the run ended."""

from __future__ import annotations

import numpy as np

from spheretwin.models.telemetry.status import Level, Status
from spheretwin.models.telemetry.table import Table

Event = tuple[float, Level, str]
"""Simulated time in s, level, text."""

# Chattering currents touch the limit for single ticks; pauses shorter than this are one event.
QUIET_S = 0.1


class Events:
    """Finds the events of a run in its telemetry, chunk by chunk."""

    def __init__(self) -> None:
        self._now_s = 0.0
        self._last_saturated_s = -np.inf

    def of(self, rows: Table) -> list[Event]:
        """Events of one chunk."""
        t, scale = rows["t_s"], rows["allocation_scale"]
        events: list[Event] = []
        for i in np.flatnonzero(scale < 1):
            if t[i] - self._last_saturated_s > QUIET_S:
                text = f"current limit reached: {100 * scale[i]:.0f} % of the commanded torque"
                events.append((float(t[i]), Level.WARN, text))
            self._last_saturated_s = t[i]
        self._now_s = float(t[-1])
        return events

    def end(self, status: Status) -> Event:
        """Event of the run's end."""
        return self._now_s, status.level, status.told
