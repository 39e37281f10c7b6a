"""Events in a run's log: saturation, loss of rank, and the end of the run."""

from __future__ import annotations

import numpy as np

from spheretwin.models.telemetry.allocation import rank_lost, saturated
from spheretwin.models.telemetry.status import Level, Status
from spheretwin.models.telemetry.table import Table

Event = tuple[float, Level, str]
"""Simulated time in s, level, text."""

# Chattering currents touch the limit for single ticks; pauses shorter than this are one event.
QUIET_S = 0.1

RANK_LOST = "rank lost: the groups in use give no torque in one direction, and no currents are commanded"


class Events:
    """Finds the events of a run in its telemetry, chunk by chunk."""

    def __init__(self) -> None:
        self._now_s = 0.0
        self._last_saturated_s = self._last_lost_s = -np.inf

    def of(self, rows: Table) -> list[Event]:
        """Events of one chunk."""
        t, scale = rows["t_s"], rows["allocation_scale"]
        events: list[Event] = []
        for i in np.flatnonzero(rank_lost(rows)):
            if t[i] - self._last_lost_s > QUIET_S:
                events.append((float(t[i]), Level.WARN, RANK_LOST))
            self._last_lost_s = t[i]
        for i in np.flatnonzero(saturated(rows)):
            if t[i] - self._last_saturated_s > QUIET_S:
                text = f"current limit reached: {100 * scale[i]:.0f} % of the commanded torque"
                events.append((float(t[i]), Level.WARN, text))
            self._last_saturated_s = t[i]
        self._now_s = float(t[-1])
        return sorted(events, key=lambda event: event[0])

    def end(self, status: Status) -> Event:
        """Event of the run's end."""
        return self._now_s, status.level, status.told
