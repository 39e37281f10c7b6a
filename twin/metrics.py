"""Metrics of a run: compiled reducers of its rows, and the list of their names."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.applied_torque import lag_step
from spheretwin.models.base.compiled import rounding_each
from spheretwin.models.coil_group import of_each_group
from spheretwin.models.telemetry.signals import ANGLES
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

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        section, groups = planned.scenario.drive, len(planned.actuator.groups)
        lag_s, period_s = of_each_group(section.lag_s, groups), planned.period_s
        spans = (lag_s, planned.scenario.plant.step_s), (lag_s, period_s), (0.5 * lag_s, period_s)
        step, tick, tick_squared = (lag_step(span_s, lag)[1] for lag, span_s in spans)
        squares, logged_W = np.zeros((2, groups))
        follows = not section.converts
        self.state = CopperState(
            step, tick, tick_squared, float(section.current_limit_A), follows, squares, logged_W
        )

    def value(self) -> float | None:
        """Return the loss in J; None without a row."""
        if not self._rows:
            return None
        resistance_ohm = self.planned.scenario.drive.resistance_ohm
        heat_W = np.sum(np.multiply(resistance_ohm, self.state.squares)) + np.sum(self.state.logged_W)
        return float(heat_W * self.planned.period_s)


class VariationState(NamedTuple):
    """State of `CurrentVariation`."""

    variation: Array  # (n,) A
    last: Array  # (n,) A, of the last tick


@rounding_each
def _add_variation(rows: Array, first: int, columns: tuple[int, ...], state: VariationState) -> None:
    (command,) = columns
    for i in range(rows.shape[0]):
        for j in range(state.last.shape[0]):
            if first + i > 0:
                state.variation[j] += abs(rows[i, command + j] - state.last[j])
            state.last[j] = rows[i, command + j]


class CurrentVariation(Metric):
    """Total variation of ``current_command_A`` per group and second, A/s.

    Σ|Δi| from tick to tick, mean over the groups, divided by the time from the first tick to the last. It
    uses the commands, not the currents: a command is held from tick to tick, so that the rows contain its
    complete variation, and the lag of the coils does not smooth it.
    """

    state: VariationState
    reads = ("current_command_A",)
    add = staticmethod(_add_variation)

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        groups = len(planned.actuator.groups)
        self.state = VariationState(np.zeros(groups), np.zeros(groups))

    def value(self) -> float | None:
        """Return the variation in A/s; None with fewer than two rows."""
        if self._rows < 2:
            return None
        return float(self.state.variation.mean() / ((self._rows - 1) * self.planned.period_s))


class Largest(NamedTuple):
    """Largest values so far; minus infinity before the first row."""

    values: Array


@rounding_each
def _add_currents(rows: Array, first: int, columns: tuple[int, ...], state: Largest) -> None:
    (current,) = columns
    for i in range(rows.shape[0]):
        for j in range(state.values.shape[0]):
            state.values[j] = max(state.values[j], abs(rows[i, current + j]))


class MaxAbsCurrent(Metric):
    """Largest ``|current_A|`` of any group, A: of means over the physics step that begins at each tick."""

    state: Largest
    reads = ("current_A",)
    add = staticmethod(_add_currents)

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        self.state = Largest(np.full(len(planned.actuator.groups), -np.inf))

    def value(self) -> float | None:
        """Return the current in A; None without a row."""
        return float(self.state.values.max()) if self._rows else None


class SumOfSquares(NamedTuple):
    """Sum of the squares of three columns."""

    values: Array  # (3,)


@rounding_each
def _add_torque(rows: Array, first: int, columns: tuple[int, ...], state: SumOfSquares) -> None:
    (torque,) = columns
    for i in range(rows.shape[0]):
        for j in range(3):
            state.values[j] += rows[i, torque + j] * rows[i, torque + j]


class RmsTorque(Metric):
    """Root mean square over the run of the length of ``torque_Nm``, N·m.

    The length is that of the Cartesian vector (x, y, z) of the coil torque, at the physics step that begins
    at each tick.
    """

    state: SumOfSquares
    reads = ("torque_Nm",)
    add = staticmethod(_add_torque)

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        self.state = SumOfSquares(np.zeros(3))

    def value(self) -> float | None:
        """Return the torque in N·m; None without a row."""
        return float(np.sqrt(self.state.values.sum() / self._rows)) if self._rows else None


# Above this share of ticks at the current limit a run has a warning.
SATURATED_SHARE = 0.05


class Shares(NamedTuple):
    """State of `SaturatedFraction`."""

    ticks: NDArray[np.int64]  # (2,) with reduced torque, with a torque matrix of less than rank 3


@rounding_each
def _add_shares(rows: Array, first: int, columns: tuple[int, ...], state: Shares) -> None:
    (scale,) = columns
    for i in range(rows.shape[0]):
        state.ticks[0] += 0.0 < rows[i, scale] < 1.0
        state.ticks[1] += rows[i, scale] == 0.0


class SaturatedFraction(Metric):
    """Share of the ticks at which the current limit reduced the commanded torque, 0 to 1."""

    state: Shares
    reads = ("allocation_scale",)
    add = staticmethod(_add_shares)

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        self.state = Shares(np.zeros(2, dtype=np.int64))

    def value(self) -> float | None:
        """Return the share, 0 to 1; None without a row."""
        return int(self.state.ticks[0]) / self._rows if self._rows else None

    def warnings(self) -> list[str]:
        """Return warnings if the limit, or a torque matrix without full rank, determines the figures."""
        warnings = []
        if rank_lost := int(self.state.ticks[1]):
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
def _add_error(rows: Array, first: int, columns: tuple[int, ...], state: Largest) -> None:
    (error,) = columns
    for i in range(rows.shape[0]):
        for j in range(3):
            state.values[j] = max(state.values[j], abs(rows[i, error + j]))


class MaxAbsError(Metric):
    """Largest ``|error_rad|`` of each hinge over the whole run, its start included, [3] in rad."""

    labels = ANGLES
    state: Largest
    reads = ("error_rad",)
    add = staticmethod(_add_error)

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        self.state = Largest(np.full(3, -np.inf))

    def value(self) -> list[float] | None:
        """Return [3] in rad; None without a row."""
        return self.state.values.tolist() if self._rows else None


PIECE_TICKS = 256


class Pieces(NamedTuple):
    """Sums of squares over pieces of 256 ticks, one of which begins at half of the planned ticks.

    They give the value of the second half without the rows, and grow by a kilobyte for 10,000 ticks.
    """

    offset: int  # ticks of the first piece, which may be shorter
    sums: Array  # (pieces, 3) rad²


@rounding_each
def _add_pieces(rows: Array, first: int, columns: tuple[int, ...], state: Pieces) -> None:
    (error,) = columns
    for i in range(rows.shape[0]):
        piece = (first + i - state.offset) // PIECE_TICKS + 1
        for j in range(3):
            state.sums[piece, j] += rows[i, error + j] * rows[i, error + j]


class RmsError(Metric):
    """Root mean square of ``error_rad`` of each hinge over the whole run, [3] in rad."""

    labels = ANGLES
    state: Pieces
    reads = ("error_rad",)
    add = staticmethod(_add_pieces)

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        self.state = Pieces(planned.ticks // 2 % PIECE_TICKS, np.zeros((1, 3)))

    def begin(self, rows: int) -> int:
        """Prepare the state for a chunk of some rows; return the tick of its first row."""
        first = super().begin(rows)
        if (missing := self._piece(self._rows - 1) + 1 - len(self.state.sums)) > 0:
            self.state = self.state._replace(sums=np.concatenate([self.state.sums, np.zeros((missing, 3))]))
        return first

    def value(self) -> list[float] | None:
        """Return [3] in rad; None without a row."""
        return self._rms(0)

    def _rms(self, piece: int) -> list[float] | None:
        """Return the root mean square from the first tick of a piece on; None without a row."""
        if not self._rows:
            return None
        begins = max(0, (piece - 1) * PIECE_TICKS + self.state.offset)
        return np.sqrt(self.state.sums[piece:].sum(axis=0) / (self._rows - begins)).tolist()

    def _piece(self, tick: int) -> int:
        """Return the piece that contains a tick."""
        return (tick - self.state.offset) // PIECE_TICKS + 1


BAND_rad = 0.01
"""Settling band of every hinge: the usual 5 % of 0.2 rad, the amplitude of the shipped motions."""


class LastOutside(NamedTuple):
    """State of `SettlingTime`."""

    tick: NDArray[np.int64]  # (3,) last one outside the band; -1 for none


@rounding_each
def _add_outside(rows: Array, first: int, columns: tuple[int, ...], state: LastOutside) -> None:
    (error,) = columns
    for i in range(rows.shape[0]):
        for j in range(3):
            if abs(rows[i, error + j]) > BAND_rad:
                state.tick[j] = first + i


class SettlingTime(Metric):
    """Time from which ``|error_rad|`` of each hinge stays within 0.01 rad to the end, [3] in s.

    0 for a hinge that never leaves the band, None for a hinge that is outside at the last tick. A change
    during the run affects the time only through the error.
    """

    labels = ANGLES
    state: LastOutside
    reads = ("error_rad",)
    add = staticmethod(_add_outside)

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        self.state = LastOutside(np.full(3, -1))

    def value(self) -> list[float | None] | None:
        """Return [3] in s; None without a row."""
        if not self._rows:
            return None
        settled = (self.state.tick + 1).tolist()
        return [tick * self.planned.period_s if tick < self._rows else None for tick in settled]


class Crossing(NamedTuple):
    """State of `Overshoot`."""

    start: Array  # (3,) rad, error at the first tick
    largest: Array  # (3,) rad


@rounding_each
def _add_crossing(rows: Array, first: int, columns: tuple[int, ...], state: Crossing) -> None:
    (error,) = columns
    for i in range(rows.shape[0]):
        for j in range(3):
            if first + i == 0:
                state.start[j] = rows[i, error + j]
            beyond = -rows[i, error + j] if state.start[j] > 0.0 else rows[i, error + j]
            state.largest[j] = max(state.largest[j], beyond)


class Overshoot(Metric):
    """Largest ``error_rad`` of each hinge with the sign opposite to that of the initial error, [3] in rad.

    0 for a hinge that never crosses its reference, None for a hinge that begins within 0.01 rad of it, the
    settling band: without a step there is no overshoot.
    """

    labels = ANGLES
    state: Crossing
    reads = ("error_rad",)
    add = staticmethod(_add_crossing)

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        self.state = Crossing(np.zeros(3), np.zeros(3))

    def value(self) -> list[float | None] | None:
        """Return [3] in rad; None without a row."""
        if not self._rows:
            return None
        steps = np.abs(self.state.start) > BAND_rad
        return [
            float(largest) if step else None for largest, step in zip(self.state.largest, steps, strict=True)
        ]


class TailRmsError(RmsError):
    """Root mean square of ``error_rad`` of each hinge over the second half of the run, [3] in rad.

    The second half begins at exactly half of the planned ticks, and in a run that ended early within 256
    ticks before its half.
    """

    def value(self) -> list[float] | None:
        """Return [3] in rad; None without a row."""
        return self._rms(self._piece(self._rows // 2))


@rounding_each
def _add_temperature(rows: Array, first: int, columns: tuple[int, ...], state: Largest) -> None:
    (temperature,) = columns
    if temperature >= 0:
        for i in range(rows.shape[0]):
            state.values[0] = max(state.values[0], rows[i, temperature])


class RotorTemperature(Metric):
    """Largest temperature of the magnets, °C, which only decides about a warning."""

    state: Largest
    reads = ("rotor_temperature_degC",)
    add = staticmethod(_add_temperature)

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        self.state = Largest(np.full(1, -np.inf))

    def value(self) -> float | None:
        """Return the temperature in °C; None without one."""
        return float(self.state.values[0]) if self.state.values[0] > -np.inf else None

    def warnings(self) -> list[str]:
        """Return a warning if magnets may have been demagnetised, which the model does not contain."""
        largest, knee_degC = self.state.values[0], self.planned.scenario.plant.thermal.knee_degC
        if not largest > knee_degC:
            return []
        return [
            f"the magnets reached {largest:.1f} °C, above plant.thermal.knee_degC"
            f" {knee_degC:g} °C: a lasting loss of remanence is possible and not simulated"
        ]


METRICS: dict[str, type[Metric]] = {
    "max_abs_error_rad": MaxAbsError,
    "rms_error_rad": RmsError,
    "tail_rms_error_rad": TailRmsError,
    "settling_time_s": SettlingTime,
    "overshoot_rad": Overshoot,
    "max_abs_current_A": MaxAbsCurrent,
    "saturated_fraction": SaturatedFraction,
    "rms_torque_Nm": RmsTorque,
    "current_variation_A_s": CurrentVariation,
    "copper_loss_J": CopperLoss,
}

CHECKS: tuple[type[Metric], ...] = (RotorTemperature,)
"""Quantities that give warnings and no figures."""
