"""The heat that the currents leave in the coils."""

from __future__ import annotations

import numpy as np

from spheretwin.models.telemetry.table import Table
from spheretwin.twin.electronics.driving.lag import drive
from spheretwin.twin.metrics.metric import Metric, Planned, added


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
        self._follows = not section.converts
        self._resistance_ohm = section.resistance_ohm or planned.actuator.group.resistance_ohm
        self._rows, self._squares = 0, np.zeros(len(planned.actuator.groups))
        self._told_W = np.zeros(len(planned.actuator.groups))

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, at least one."""
        self._rows += len(rows)
        if any(signal.name == "copper_loss_W" for signal in rows.signals):
            self._told_W = added(self._told_W, rows["copper_loss_W"])
            return
        if not self._follows:
            self._squares = added(self._squares, rows["current_A"] ** 2)
            return
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
        heat_W = np.sum(self._resistance_ohm * self._squares) + np.sum(self._told_W)
        return float(heat_W * self.planned.period_s)
