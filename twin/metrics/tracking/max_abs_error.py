"""The largest tracking error of each axis."""

from __future__ import annotations

import numpy as np

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.table import Table
from spheretwin.twin.metrics.metric import Metric, Planned
from spheretwin.twin.metrics.reducing import raise_to_largest


class MaxAbsError(Metric):
    """Largest ``|error_rad|`` of each hinge over the whole run, its start included, [3] in rad."""

    labels = ANGLES

    def __init__(self, planned: Planned) -> None:
        super().__init__(planned)
        self._largest = np.full(3, -np.inf)

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, at least one."""
        raise_to_largest(np.ascontiguousarray(rows["error_rad"]), self._largest)

    def value(self) -> list[float] | None:
        """[3] in rad; None without a row."""
        return self._largest.tolist() if self._largest[0] >= 0 else None
