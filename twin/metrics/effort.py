"""Metrics of the effort of a run: currents, torque, losses, limits, temperature of the magnets."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.applied_torque import lag_step
from spheretwin.metrics.tracking import add_largest
from spheretwin.models.base.compiled import rounding_each
from spheretwin.models.coil_group import of_each_group
from spheretwin.reduction import Metric, PlannedRun

Array = NDArray[np.float64]


class CopperState(NamedTuple):
    """State of `CopperLoss`."""

    first_step: Array  # (n,) mean remaining share of the distance to the command over the first physics step
    tick: Array  # (n,) the same over the tick
    tick_squared: Array  # (n,) of its square, which decays twice as fast, over the tick
    limit_A: float
    follows: bool  # true if the currents relax towards the commands
    squares: Array  # (n,) A²
    logged_W: Array  # (n,)


@rounding_each
def _add_copper_loss(rows: Array, first: int, columns: tuple[int, ...], state: CopperState) -> None:
    logged, current, command = columns
    for i in range(rows.shape[0]):
        for j in range(state.squares.shape[0]):
            if logged >= 0:
                state.logged_W[j] += rows[i, logged + j]
            elif not state.follows:
                state.squares[j] += rows[i, current + j] * rows[i, current + j]
            else:
                target = min(max(rows[i, command + j], -state.limit_A), state.limit_A)
                distance = 0.0  # at the start of the tick; 0 without a lag
                if state.first_step[j] > 0.0:
                    distance = (rows[i, current + j] - target) / state.first_step[j]
                crossed = 2.0 * state.tick[j] * target * distance
                decayed = state.tick_squared[j] * (distance * distance)
                state.squares[j] += target * target + crossed + decayed


class CopperLoss(Metric):
    """Energy lost in the copper over the run, ∫ R i² dt added over the groups, J.

    With a supply the telemetry contains the loss, ``copper_loss_W``, with R at the present temperature.
    Without one, R is that of a cold group. Within a tick each current relaxes exponentially towards its
    command; ``current_A``, its mean over the physics step that begins at the tick, determines its initial
    value, so that the integral over the tick is exact, also under chattering. Lag and limit of the drive are
    those at the start of the run: the rows do not contain their changes. After a delay or a converter, which
    act between command and target, ``current_A`` is used for the complete tick. The tick in which a run ends
    counts completely.
    """

    state: CopperState
    reads = ("copper_loss_W", "current_A", "current_command_A")
    add = staticmethod(_add_copper_loss)

    def start(self, planned: PlannedRun) -> CopperState:
        """Return shares of the lag, and no loss."""
        section, groups = planned.scenario.drive, len(planned.actuator.groups)
        lag_s, period_s = of_each_group(section.lag_s, groups), planned.period_s
        spans = (lag_s, planned.scenario.plant.step_s), (lag_s, period_s), (0.5 * lag_s, period_s)
        step, tick, tick_squared = (lag_step(span_s, lag)[1] for lag, span_s in spans)
        squares, logged_W = np.zeros((2, groups))
        limit_A, follows = float(section.current_limit_A), not section.converts
        return CopperState(step, tick, tick_squared, limit_A, follows, squares, logged_W)

    def result(self) -> float:
        """Return the loss in J."""
        resistance_ohm = self.planned.scenario.drive.resistance_ohm
        heat_W = np.sum(np.multiply(resistance_ohm, self.state.squares)) + np.sum(self.state.logged_W)
        return float(heat_W * self.planned.period_s)


@rounding_each
def _add_variation(rows: Array, first: int, columns: tuple[int, ...], state: Array) -> None:
    (command,) = columns
    for i in range(rows.shape[0]):
        for j in range(state.shape[1]):
            if first + i > 0:
                state[0, j] += abs(rows[i, command + j] - state[1, j])
            state[1, j] = rows[i, command + j]


class CurrentVariation(Metric):
    """Total variation of ``current_command_A`` per group and second, A/s.

    Σ|Δi| from tick to tick, mean over the groups, divided by the time from the first tick to the last. It
    uses the commands, not the currents: a command is held from tick to tick, so that the rows contain its
    complete variation, and the lag of the coils does not smooth it.
    """

    reads = ("current_command_A",)
    add = staticmethod(_add_variation)
    least_rows = 2

    def start(self, planned: PlannedRun) -> Array:
        """Return the variation and the last command of each group, (2, n) in A."""
        return np.zeros((2, len(planned.actuator.groups)))

    def result(self) -> float:
        """Return the variation in A/s."""
        return float(self.state[0].mean() / ((self._rows - 1) * self.planned.period_s))


class MaxAbsCurrent(Metric):
    """Largest ``|current_A|`` of any group, A: of means over the physics step that begins at each tick."""

    reads = ("current_A",)
    add = staticmethod(add_largest)

    def start(self, planned: PlannedRun) -> Array:
        """Return the largest magnitudes (n,), minus infinity before the first row."""
        return np.full(len(planned.actuator.groups), -np.inf)

    def result(self) -> float:
        """Return the current in A."""
        return float(self.state.max())


@rounding_each
def _add_torque(rows: Array, first: int, columns: tuple[int, ...], squares: Array) -> None:
    (torque,) = columns
    for i in range(rows.shape[0]):
        for j in range(3):
            squares[j] += rows[i, torque + j] * rows[i, torque + j]


class RmsTorque(Metric):
    """Root mean square over the run of the length of ``torque_Nm``, N·m.

    The length is that of the Cartesian vector (x, y, z) of the coil torque, at the physics step that begins
    at each tick.
    """

    reads = ("torque_Nm",)
    add = staticmethod(_add_torque)

    def start(self, planned: PlannedRun) -> Array:
        """Return the sums of squares (3,)."""
        return np.zeros(3)

    def result(self) -> float:
        """Return the torque in N·m."""
        return float(np.sqrt(self.state.sum() / self._rows))


SATURATED_SHARE = 0.05


@rounding_each
def _add_shares(rows: Array, first: int, columns: tuple[int, ...], ticks: NDArray[np.int64]) -> None:
    (scale,) = columns
    for i in range(rows.shape[0]):
        ticks[0] += 0.0 < rows[i, scale] < 1.0
        ticks[1] += rows[i, scale] == 0.0


class SaturatedFraction(Metric):
    """Share of the ticks at which the current limit reduced the commanded torque, 0 to 1."""

    reads = ("allocation_scale",)
    add = staticmethod(_add_shares)

    def start(self, planned: PlannedRun) -> NDArray[np.int64]:
        """Return the ticks with reduced torque, and with a torque matrix of less than rank 3."""
        return np.zeros(2, dtype=np.int64)

    def result(self) -> float:
        """Return the share, 0 to 1."""
        return int(self.state[0]) / self._rows

    def warnings(self) -> list[str]:
        """Return warnings if the limit, or a torque matrix without full rank, determines the figures."""
        warnings = []
        if rank_lost := int(self.state[1]):
            warnings.append(
                "the torque matrix of the groups in use has less than rank 3 at"
                f" {rank_lost} of {self._rows} ticks: no currents are commanded there"
            )
        share = self.value() or 0.0
        if share > SATURATED_SHARE:
            warnings.append(
                f"the current limit reduced the torque at {100 * share:.0f} % of the ticks: the figures"
                " depend more on the limit than on the law"
            )
        return warnings


@rounding_each
def _add_temperature(rows: Array, first: int, columns: tuple[int, ...], largest: Array) -> None:
    (temperature,) = columns
    if temperature >= 0:
        for i in range(rows.shape[0]):
            largest[0] = max(largest[0], rows[i, temperature])


class RotorTemperature(Metric):
    """Largest temperature of the magnets, °C, which only decides about a warning."""

    reads = ("rotor_temperature_degC",)
    add = staticmethod(_add_temperature)

    def start(self, planned: PlannedRun) -> Array:
        """Return the temperature (1,), minus infinity before the first one."""
        return np.full(1, -np.inf)

    def result(self) -> float | None:
        """Return the temperature in °C; None without one."""
        return float(self.state[0]) if self.state[0] > -np.inf else None

    def warnings(self) -> list[str]:
        """Return a warning if magnets may have been demagnetised, which the model does not contain."""
        largest, knee_degC = self.state[0], self.planned.scenario.plant.thermal.knee_degC
        if not largest > knee_degC:
            return []
        return [
            f"the magnets reached {largest:.1f} °C, above plant.thermal.knee_degC"
            f" {knee_degC:g} °C: a lasting loss of remanence is possible and not simulated"
        ]
