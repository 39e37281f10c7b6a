"""The torque that a run took."""

from __future__ import annotations

import numpy as np

from spheretwin.models.telemetry.table import Table
from spheretwin.twin.metrics.metric import Metric, Planned
from spheretwin.twin.metrics.reducing import add_squares


class RmsTorque(Metric):
    """Root mean square over the run of the length of ``torque_Nm``, N·m.

    The length is that of the Cartesian vector, x, y and z in one figure: what the coils gave, at the
    physics step that begins at each tick.
    """

    def __init__(self, planned: Planned) -> None:
        super().__init__(planned)
        self._rows, self._squares = 0, np.zeros(3)

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, at least one."""
        self._rows += len(rows)
        add_squares(np.ascontiguousarray(rows["torque_Nm"]), self._squares)

    def value(self) -> float | None:
        """In N·m; None without a row."""
        return float(np.sqrt(self._squares.sum() / self._rows)) if self._rows else None
