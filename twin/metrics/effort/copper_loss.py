"""The heat that the currents leave in the coils."""

from __future__ import annotations

import numpy as np

from spheretwin.models.telemetry.table import Table
from spheretwin.twin.metrics.metric import Metric, Planned, added
from spheretwin.twin.plant.drive import drive


class CopperLoss(Metric):
    """Energy lost in the copper over the run, ∫ R i² dt added over the groups, J.

    R is the model file's resistance of a group. Within a tick each current goes from where it was towards
    its command as the drive's exponential; ``current_A``, its mean over the physics step that begins at the
    tick, tells where it was, so that the integral over the tick is exact, however hard a law chatters.
    Neglected is that R grows with temperature. Lag and limit of the drive are those at the start of the run:
    the rows do not say where they change on the way. A tick in which a run ends counts whole.
    """

    def __init__(self, planned: Planned) -> None:
        super().__init__(planned)
        section = planned.scenario.drive
        lag_s, self._limit_A = section.time_constant_s or 0.0, section.current_limit_A or 0.0
        # Shares of the distance to the command that are left on average: over the first step, over the tick,
        # and of its square over the tick, which decays twice as fast.
        self._first_step, self._tick, self._tick_squared = (
            drive(each_lag_s, span_s, self._limit_A).mean_share
            for each_lag_s, span_s in (
                (lag_s, planned.scenario.plant.step_s),
                (lag_s, planned.period_s),
                (0.5 * lag_s, planned.period_s),
            )
        )
        self._rows, self._squares = 0, np.zeros(len(planned.actuator.groups))

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, at least one."""
        self._rows += len(rows)
        target = np.clip(rows["current_command_A"], -self._limit_A, self._limit_A)
        distance = np.zeros_like(target)  # at the start of the tick; without a lag there is none
        if self._first_step > 0:
            distance = (rows["current_A"] - target) / self._first_step
        squares = target**2 + 2 * self._tick * target * distance + self._tick_squared * distance**2
        self._squares = added(self._squares, squares)

    def value(self) -> float | None:
        """In J; None without a row."""
        if not self._rows:
            return None
        resistance_ohm = self.planned.actuator.group.resistance_ohm
        return float(np.sum(resistance_ohm * self._squares) * self.planned.period_s)
