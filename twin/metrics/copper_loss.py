"""The heat that the currents leave in the coils."""

from __future__ import annotations

import numpy as np

from spheretwin.models.telemetry.table import Table
from spheretwin.twin.metrics.metric import Metric, Planned, added


class CopperLoss(Metric):
    """Energy lost in the copper over the run, Σ R i² T over groups and ticks, J.

    R is the model file's resistance of a group, T the control period, i ``current_A``: the mean over the
    physics step that begins at the tick, taken for the whole tick. Neglected are that a current goes on
    towards its command after that step, that the mean of a square is more than the square of a mean, and
    that R grows with temperature. Where the command stays as it is for longer than L/R, the first two are
    nothing; a law that chatters at every tick is charged too little.
    """

    def __init__(self, planned: Planned) -> None:
        super().__init__(planned)
        self._rows, self._squares = 0, np.zeros(len(planned.actuator.groups))

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, at least one."""
        self._rows += len(rows)
        self._squares = added(self._squares, rows["current_A"] ** 2)

    def value(self) -> float | None:
        """In J; None without a row."""
        if not self._rows:
            return None
        resistance_ohm = self.planned.actuator.group.resistance_ohm
        return float(np.sum(resistance_ohm * self._squares) * self.planned.period_s)
