"""How often the current limit cut the torque."""

from __future__ import annotations

import numpy as np

from spheretwin.models.telemetry.table import Table
from spheretwin.twin.metrics.metric import Metric, Planned

# Above this share of ticks at the current limit a run says so beside its figures.
SATURATED_SHARE = 0.05


class SaturatedFraction(Metric):
    """Share of the ticks at which the current limit left less than the commanded torque, 0 to 1."""

    def __init__(self, planned: Planned) -> None:
        super().__init__(planned)
        self._rows = self._saturated = 0

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, at least one."""
        self._rows += len(rows)
        self._saturated += int(np.count_nonzero(rows["allocation_scale"] < 1))

    def value(self) -> float | None:
        """0 to 1; None without a row."""
        return self._saturated / self._rows if self._rows else None

    def warnings(self) -> list[str]:
        """Say where the limit rather than the law made the figures."""
        share = self.value() or 0.0
        if share <= SATURATED_SHARE:
            return []
        return [
            f"the current limit cut the torque at {100 * share:.0f} % of the ticks: the figures are those of"
            " the limit more than of the law"
        ]
