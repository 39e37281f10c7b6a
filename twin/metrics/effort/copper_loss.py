"""The heat that the currents leave in the coils."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import rounding_each
from spheretwin.models.telemetry.table import Table
from spheretwin.twin.electronics.driving.lag import drive
from spheretwin.twin.metrics.metric import Metric, Planned
from spheretwin.twin.metrics.reducing import add_rows, add_squares

Array = NDArray[np.float64]


class CopperLoss(Metric):
    """Energy lost in the copper over the run, ∫ R i² dt added over the groups, J.

    Amplifiers with a supply tell it themselves, by ``copper_loss_W``, with R as warm as it is. Without one, R
    is that of a cold group. Within a tick each current goes from where it was towards
    its command as the drive's exponential; ``current_A``, its mean over the physics step that begins at the
    tick, tells where it was, so that the integral over the tick is exact, however hard a law chatters.
    Lag and limit of the drive are those at the start of the run: the rows do not say where they change on the
    way. Behind a delay or a converter, which come between command and target, ``current_A`` is taken for the
    whole tick. A tick in which a run ends counts whole.
    """

    def __init__(self, planned: Planned) -> None:
        super().__init__(planned)
        section = planned.scenario.drive
        lag_s, self._limit_A = section.lag_s, section.current_limit_A
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
        self._follows = not section.converts
        self._resistance_ohm = section.resistance_ohm
        self._rows, self._squares = 0, np.zeros(len(planned.actuator.groups))
        self._told_W = np.zeros(len(planned.actuator.groups))

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, at least one."""
        self._rows += len(rows)
        if any(signal.name == "copper_loss_W" for signal in rows.signals):
            add_rows(np.ascontiguousarray(rows["copper_loss_W"]), self._told_W)
            return
        if not self._follows:
            add_squares(np.ascontiguousarray(rows["current_A"]), self._squares)
            return
        command, current = (np.ascontiguousarray(rows[f"current{each}_A"]) for each in ("_command", ""))
        shares = self._first_step, self._tick, self._tick_squared
        _add_lagging_squares(command, current, self._limit_A, shares, self._squares)

    def value(self) -> float | None:
        """In J; None without a row."""
        if not self._rows:
            return None
        heat_W = np.sum(self._resistance_ohm * self._squares) + np.sum(self._told_W)
        return float(heat_W * self.planned.period_s)


@rounding_each
def _add_lagging_squares(
    command: Array, current: Array, limit_A: float, shares: tuple[float, float, float], total: Array
) -> None:
    """Add the mean squares over their ticks of currents that follow their commands (n, k) to a total (k,)."""
    first_step, tick, tick_squared = shares
    for i in range(command.shape[0]):
        for j in range(command.shape[1]):
            target = min(max(command[i, j], -limit_A), limit_A)
            distance = 0.0  # at the start of the tick; without a lag there is none
            if first_step > 0:
                distance = (current[i, j] - target) / first_step
            crossed = 2.0 * tick * target * distance
            total[j] += target * target + crossed + tick_squared * (distance * distance)
