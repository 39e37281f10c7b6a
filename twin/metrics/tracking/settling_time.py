"""When the tracking error is small for good."""

from __future__ import annotations

import numpy as np

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.table import Table
from spheretwin.twin.metrics.metric import Metric, Planned
from spheretwin.twin.metrics.reducing import note_last_outside

BAND_rad = 0.01
"""The usual 5 % band around 0.2 rad, the amplitude of the shipped motions.

Of a fixed size: a share of each run's own excursion would leave a spinning hinge, which goes many turns, a
band as wide as its errors.
"""


class SettlingTime(Metric):
    """Time from which on ``|error_rad|`` of each hinge stays within 0.01 rad to the end, [3] in s.

    0 for a hinge that never leaves the band, None for one that is outside at the last tick. A change on the
    way starts the clock anew only by what it does to the error.
    """

    labels = ANGLES

    def __init__(self, planned: Planned) -> None:
        super().__init__(planned)
        self._rows, self._last_outside = 0, np.full(3, -1)

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, at least one."""
        note_last_outside(np.ascontiguousarray(rows["error_rad"]), BAND_rad, self._rows, self._last_outside)
        self._rows += len(rows)

    def value(self) -> list[float | None] | None:
        """[3] in s; None without a row."""
        if not self._rows:
            return None
        settled = (self._last_outside + 1).tolist()
        return [tick * self.planned.period_s if tick < self._rows else None for tick in settled]
