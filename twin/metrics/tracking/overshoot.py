"""How far a hinge goes past what it was to reach."""

from __future__ import annotations

import numpy as np

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.table import Table
from spheretwin.twin.metrics.metric import Metric, Planned
from spheretwin.twin.metrics.reducing import raise_to_farthest
from spheretwin.twin.metrics.tracking.settling_time import BAND_rad


class Overshoot(Metric):
    """Largest ``error_rad`` of each hinge on the other side of its reference than it began, [3] in rad.

    0 for one that never crosses it, None for one that begins within 0.01 rad of it, the band of settling:
    there is no step that it could overshoot.
    """

    labels = ANGLES

    def __init__(self, planned: Planned) -> None:
        super().__init__(planned)
        self._rows, self._start, self._largest = 0, np.zeros(3), np.zeros(3)

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, at least one."""
        error = np.ascontiguousarray(rows["error_rad"])
        if not self._rows:
            self._start = error[0].copy()
        self._rows += len(rows)
        raise_to_farthest(error, -np.sign(self._start), self._largest)

    def value(self) -> list[float | None] | None:
        """[3] in rad; None without a row."""
        if not self._rows:
            return None
        steps = np.abs(self._start) > BAND_rad
        return [float(far) if step else None for far, step in zip(self._largest, steps, strict=True)]
