"""Metrics of the effort of a run: currents, torque, losses, limits, temperature of the magnets."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.applied_torque import lag_step
from spheretwin.metrics.reduction import Metric, PlannedRun
from spheretwin.metrics.tracking import add_largest
from spheretwin.models.base.arrays import Array, Integers
from spheretwin.models.base.compiled import rounding_each


class CopperState(NamedTuple):
    """State of `CopperLoss`."""

    first_step: Array  # (runs, n) mean share of the distance to the command over the first physics step
    tick: Array  # (runs, n) the same over the tick
    tick_squared: Array  # (runs, n) of its square, which decays twice as fast, over the tick
    limit_A: Array  # (runs,)
    follows: bool  # true if the currents relax towards the commands
    squares: Array  # (runs, n) A²
    logged_W: Array  # (runs, n)


@rounding_each
def _add_copper_loss(rows: Array, first: int, columns: tuple[int, ...], state: CopperState, run: int) -> None:
    logged, current, command = columns
    limit_A, squares = state.limit_A[run], state.squares
    for i in range(rows.shape[0]):
        for j in range(squares.shape[1]):
            if logged >= 0:
                state.logged_W[run, j] += rows[i, logged + j]
            elif not state.follows:
                squares[run, j] += rows[i, current + j] * rows[i, current + j]
            else:
                target = min(max(rows[i, command + j], -limit_A), limit_A)
                distance = 0.0  # at the start of the tick; 0 without a lag
                if state.first_step[run, j] > 0.0:
                    distance = (rows[i, current + j] - target) / state.first_step[run, j]
                crossed = 2.0 * state.tick[run, j] * target * distance
                decayed = state.tick_squared[run, j] * (distance * distance)
                squares[run, j] += target * target + crossed + decayed


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
        section, runs, groups = planned.scenario.drive, planned.runs, len(planned.actuator.groups)
        lag_s, period_s = np.asarray(section.lag_s, float), planned.period_s
        spans = (lag_s, planned.scenario.plant.step_s), (lag_s, period_s), (0.5 * lag_s, period_s)
        shares = (np.broadcast_to(lag_step(span_s, lag)[1], (runs, groups)) for lag, span_s in spans)
        step, tick, tick_squared = map(np.ascontiguousarray, shares)
        squares, logged_W = np.zeros((2, runs, groups))
        limit_A = np.array(np.broadcast_to(section.current_limit_A, (runs, 1))[:, 0], float)
        return CopperState(step, tick, tick_squared, limit_A, not section.converts, squares, logged_W)

    def results(self, rows: Integers) -> list[float]:
        """Return the loss of each run in J."""
        heated = np.multiply(self.planned.scenario.drive.resistance_ohm, self.state.squares)
        heat_W = heated.sum(axis=1) + self.state.logged_W.sum(axis=1)
        return (heat_W * self.planned.period_s).tolist()


@rounding_each
def _add_variation(rows: Array, first: int, columns: tuple[int, ...], state: Array, run: int) -> None:
    (command,) = columns
    for i in range(rows.shape[0]):
        for j in range(state.shape[2]):
            if first + i > 0:
                state[run, 0, j] += abs(rows[i, command + j] - state[run, 1, j])
            state[run, 1, j] = rows[i, command + j]


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
        """Return the variation and the last command of each group, (runs, 2, n) in A."""
        return np.zeros((planned.runs, 2, len(planned.actuator.groups)))

    def results(self, rows: Integers) -> list[float]:
        """Return the variation of each run in A/s."""
        return (self.state[:, 0].mean(axis=1) / ((rows - 1) * self.planned.period_s)).tolist()


class MaxAbsCurrent(Metric):
    """Largest ``|current_A|`` of any group, A: of means over the physics step that begins at each tick."""

    reads = ("current_A",)
    add = staticmethod(add_largest)

    def start(self, planned: PlannedRun) -> Array:
        """Return the largest magnitudes (runs, n), minus infinity before the first row."""
        return np.full((planned.runs, len(planned.actuator.groups)), -np.inf)

    def results(self, rows: Integers) -> list[float]:
        """Return the current of each run in A."""
        return self.state.max(axis=1).tolist()


@rounding_each
def _add_torque(rows: Array, first: int, columns: tuple[int, ...], squares: Array, run: int) -> None:
    (torque,) = columns
    for i in range(rows.shape[0]):
        for j in range(3):
            squares[run, j] += rows[i, torque + j] * rows[i, torque + j]


class RmsTorque(Metric):
    """Root mean square over the run of the length of ``torque_Nm``, N·m.

    The length is that of the Cartesian vector (x, y, z) of the coil torque, at the physics step that begins
    at each tick.
    """

    reads = ("torque_Nm",)
    add = staticmethod(_add_torque)

    def start(self, planned: PlannedRun) -> Array:
        """Return the sums of squares (runs, 3)."""
        return np.zeros((planned.runs, 3))

    def results(self, rows: Integers) -> list[float]:
        """Return the torque of each run in N·m."""
        return np.sqrt(self.state.sum(axis=1) / rows).tolist()


SATURATED_SHARE = 0.05


@rounding_each
def _add_shares(
    rows: Array, first: int, columns: tuple[int, ...], ticks: NDArray[np.int64], run: int
) -> None:
    (scale,) = columns
    for i in range(rows.shape[0]):
        ticks[run, 0] += 0.0 < rows[i, scale] < 1.0
        ticks[run, 1] += rows[i, scale] == 0.0


class SaturatedFraction(Metric):
    """Share of the ticks at which the current limit reduced the commanded torque, 0 to 1."""

    reads = ("allocation_scale",)
    add = staticmethod(_add_shares)

    def start(self, planned: PlannedRun) -> NDArray[np.int64]:
        """Return the ticks with reduced torque, and with a torque matrix of less than rank 3, (runs, 2)."""
        return np.zeros((planned.runs, 2), dtype=np.int64)

    def results(self, rows: Integers) -> list[float]:
        """Return the share of each run, 0 to 1."""
        return (self.state[:, 0] / rows).tolist()

    def warnings(self) -> list[str]:
        """Return warnings if the limit, or a torque matrix without full rank, determines the figures."""
        warnings = []
        if rank_lost := int(self.state[0, 1]):
            warnings.append(
                "the torque matrix of the groups in use has less than rank 3 at"
                f" {rank_lost} of {self.rows[0]} ticks: no currents are commanded there"
            )
        share = self.values()[0] or 0.0
        if share > SATURATED_SHARE:
            warnings.append(
                f"the current limit reduced the torque at {100 * share:.0f} % of the ticks: the figures"
                " depend more on the limit than on the law"
            )
        return warnings


@rounding_each
def _add_temperature(rows: Array, first: int, columns: tuple[int, ...], largest: Array, run: int) -> None:
    (temperature,) = columns
    if temperature >= 0:
        for i in range(rows.shape[0]):
            largest[run] = max(largest[run], rows[i, temperature])


class RotorTemperature(Metric):
    """Largest temperature of the magnets, °C, which only decides about a warning."""

    reads = ("rotor_temperature_degC",)
    add = staticmethod(_add_temperature)

    def start(self, planned: PlannedRun) -> Array:
        """Return the temperatures (runs,), minus infinity before the first one."""
        return np.full(planned.runs, -np.inf)

    def results(self, rows: Integers) -> list[float | None]:
        """Return the temperature of each run in °C; None without one."""
        return [largest if largest > -np.inf else None for largest in self.state.tolist()]

    def warnings(self) -> list[str]:
        """Return a warning if magnets may have been demagnetised, which the model does not contain."""
        largest, knee_degC = self.state[0], self.planned.scenario.plant.thermal.knee_degC
        if not largest > knee_degC:
            return []
        return [
            f"the magnets reached {largest:.1f} °C, above plant.thermal.knee_degC"
            f" {knee_degC:g} °C: a lasting loss of remanence is possible and not simulated"
        ]


@rounding_each
def _add_share(rows: Array, first: int, columns: tuple[int, ...], outside: Array, run: int) -> None:
    (share,) = columns
    if share >= 0:
        for i in range(rows.shape[0]):
            outside[run] += rows[i, share] < 1.0


class LearnedRange(Metric):
    """Ticks outside of the range of a learned torque, which only decide about a warning."""

    reads = ("learned_share",)
    add = staticmethod(_add_share)

    def start(self, planned: PlannedRun) -> Array:
        """Return the ticks (runs,)."""
        return np.zeros(planned.runs)

    def results(self, rows: Integers) -> list[float | None]:
        """Return the share of the ticks of each run."""
        return (self.state / rows).tolist()

    def warnings(self) -> list[str]:
        """Return a warning if the learned torque was left, or fades there."""
        if not self.state[0]:
            return []
        return [
            f"{100 * self.state[0] / self.rows[0]:.1f} % of the ticks are outside of the logs of"
            " plant.learned_torque, which fades to 0 there: learned_share in the telemetry"
        ]
