"""The largest current of any group."""

from __future__ import annotations

import numpy as np

from spheretwin.models.telemetry.table import Table
from spheretwin.twin.metrics.metric import Metric, Planned


class MaxAbsCurrent(Metric):
    """Largest ``|current_A|`` of any group, A: of means over the physics step that begins at each tick."""

    def __init__(self, planned: Planned) -> None:
        super().__init__(planned)
        self._largest = -np.inf

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, at least one."""
        self._largest = max(self._largest, float(np.abs(rows["current_A"]).max()))

    def value(self) -> float | None:
        """In A; None without a row."""
        return self._largest if self._largest >= 0 else None
