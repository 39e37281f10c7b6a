"""Share of the ticks at which the current limit cut the torque; warnings of the limit and of a lost rank."""

from __future__ import annotations

import numpy as np

from spheretwin.models.telemetry.allocation import rank_lost, saturated
from spheretwin.models.telemetry.table import Table
from spheretwin.twin.metrics.metric import Metric, Planned

# Above this share of ticks at the current limit a run says so beside its figures.
SATURATED_SHARE = 0.05


class SaturatedFraction(Metric):
    """Share of the ticks at which the current limit left less than the commanded torque, 0 to 1."""

    def __init__(self, planned: Planned) -> None:
        super().__init__(planned)
        self._rows = self._saturated = self._rank_lost = 0

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, at least one."""
        self._rows += len(rows)
        self._saturated += int(np.count_nonzero(saturated(rows)))
        self._rank_lost += int(np.count_nonzero(rank_lost(rows)))

    def value(self) -> float | None:
        """0 to 1; None without a row."""
        return self._saturated / self._rows if self._rows else None

    def warnings(self) -> list[str]:
        """Report where the limit, or a torque matrix without rank, determines the figures."""
        warnings = []
        if self._rank_lost:
            warnings.append(
                "the torque matrix of the groups in use has less than rank 3 at"
                f" {self._rank_lost} of {self._rows} ticks: no currents are commanded there"
            )
        share = self.value() or 0.0
        if share > SATURATED_SHARE:
            warnings.append(
                f"the current limit cut the torque at {100 * share:.0f} % of the ticks: the figures are those"
                " of the limit more than of the law"
            )
        return warnings
