"""Metrics: reducers that process a run chunk by chunk without storing its rows."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from spheretwin.electronics.coil import current_lag
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.compiled import rounding_each
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.table import Table, rank_lost, saturated
from spheretwin.scenario.sections import ResolvedScenario


@dataclass(frozen=True)
class PlannedRun:
    """Facts about a run that a metric knows before the first row.

    Attributes
    ----------
    scenario : ResolvedScenario
        Scenario at the start.
    actuator : Actuator
        Simulated actuator.
    ticks : int
        Planned control ticks; the run may end earlier.
    """

    scenario: ResolvedScenario
    actuator: Actuator
    ticks: int

    @property
    def period_s(self) -> float:
        """Control period, s."""
        return self.scenario.controller.period_s


class Metric(ABC):
    """Metric of a run; the result is bit-identical for any chunks.

    Parameters
    ----------
    planned : PlannedRun
        Facts about the run.
    """

    labels: ClassVar[tuple[str, ...]] = ()
    """Names of the entries, if the value is a list."""

    def __init__(self, planned: PlannedRun) -> None:
        self.planned, self._rows = planned, 0

    def write(self, rows: Table) -> None:
        """Process the rows of one chunk, at least one."""
        self.add(rows)
        self._rows += len(rows)

    @abstractmethod
    def add(self, rows: Table) -> None:
        """Process the rows of one chunk; `_rows` is the number of rows before it."""

    @abstractmethod
    def value(self) -> Any:
        """Return the value of the metric in JSON types; None if there are too few rows."""

    def warnings(self) -> list[str]:
        """Return warnings that concern the validity of the figures, one line each."""
        return []


Array = NDArray[np.float64]


@rounding_each
def add_rows(rows: Array, total: Array) -> None:
    """Add rows (n, k) to a total (k,), one after the other: the sum does not depend on the chunks."""
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            total[j] += rows[i, j]


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

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        section = planned.scenario.drive
        lag_s, self._limit_A = section.lag_s, section.current_limit_A
        # Mean remaining shares of the distance to the command: over the first step, over the tick, and of its
        # square over the tick, which decays twice as fast.
        self._first_step, self._tick, self._tick_squared = (
            current_lag(time_constant_s, span_s, self._limit_A).mean_share
            for time_constant_s, span_s in (
                (lag_s, planned.scenario.plant.step_s),
                (lag_s, planned.period_s),
                (0.5 * lag_s, planned.period_s),
            )
        )
        self._follows = not section.converts
        self._resistance_ohm = section.resistance_ohm
        self._squares = np.zeros(len(planned.actuator.groups))
        self._logged_W = np.zeros(len(planned.actuator.groups))

    def add(self, rows: Table) -> None:
        """Process the rows of one chunk."""
        if any(signal.name == "copper_loss_W" for signal in rows.signals):
            add_rows(np.ascontiguousarray(rows["copper_loss_W"]), self._logged_W)
        elif not self._follows:
            add_rows(rows["current_A"] ** 2, self._squares)
        else:
            target = np.clip(rows["current_command_A"], -self._limit_A, self._limit_A)
            distance = np.zeros_like(target)  # at the start of the tick; 0 without a lag
            if self._first_step > 0:
                distance = (rows["current_A"] - target) / self._first_step
            crossed = 2.0 * self._tick * target * distance
            add_rows(target**2 + crossed + self._tick_squared * distance**2, self._squares)

    def value(self) -> float | None:
        """Return the loss in J; None without a row."""
        if not self._rows:
            return None
        heat_W = np.sum(self._resistance_ohm * self._squares) + np.sum(self._logged_W)
        return float(heat_W * self.planned.period_s)


class CurrentVariation(Metric):
    """Total variation of ``current_command_A`` per group and second, A/s.

    Σ|Δi| from tick to tick, mean over the groups, divided by the time from the first tick to the last. It
    uses the commands, not the currents: a command is held from tick to tick, so that the rows contain its
    complete variation, and the lag of the coils does not smooth it.
    """

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        groups = len(planned.actuator.groups)
        self._variation = np.zeros(groups)
        self._last = np.zeros(groups)

    def add(self, rows: Table) -> None:
        """Process the rows of one chunk."""
        command = rows["current_command_A"]
        if not self._rows:
            self._last = command[0].copy()
        add_rows(np.abs(np.diff(command, axis=0, prepend=self._last[None])), self._variation)
        self._last = command[-1].copy()

    def value(self) -> float | None:
        """Return the variation in A/s; None with fewer than two rows."""
        if self._rows < 2:
            return None
        return float(self._variation.mean() / ((self._rows - 1) * self.planned.period_s))


class MaxAbsCurrent(Metric):
    """Largest ``|current_A|`` of any group, A: of means over the physics step that begins at each tick."""

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        self._largest = -np.inf

    def add(self, rows: Table) -> None:
        """Process the rows of one chunk."""
        self._largest = max(self._largest, float(np.abs(rows["current_A"]).max()))

    def value(self) -> float | None:
        """Return the current in A; None without a row."""
        return self._largest if self._largest >= 0 else None


class RmsTorque(Metric):
    """Root mean square over the run of the length of ``torque_Nm``, N·m.

    The length is that of the Cartesian vector (x, y, z) of the coil torque, at the physics step that begins
    at each tick.
    """

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        self._squares = np.zeros(3)

    def add(self, rows: Table) -> None:
        """Process the rows of one chunk."""
        add_rows(rows["torque_Nm"] ** 2, self._squares)

    def value(self) -> float | None:
        """Return the torque in N·m; None without a row."""
        return float(np.sqrt(self._squares.sum() / self._rows)) if self._rows else None


# Above this share of ticks at the current limit a run has a warning.
SATURATED_SHARE = 0.05


class SaturatedFraction(Metric):
    """Share of the ticks at which the current limit reduced the commanded torque, 0 to 1."""

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        self._saturated = self._rank_lost = 0

    def add(self, rows: Table) -> None:
        """Process the rows of one chunk."""
        self._saturated += int(np.count_nonzero(saturated(rows)))
        self._rank_lost += int(np.count_nonzero(rank_lost(rows)))

    def value(self) -> float | None:
        """Return the share, 0 to 1; None without a row."""
        return self._saturated / self._rows if self._rows else None

    def warnings(self) -> list[str]:
        """Return warnings if the limit, or a torque matrix without full rank, determines the figures."""
        warnings = []
        if self._rank_lost:
            warnings.append(
                "the torque matrix of the groups in use has less than rank 3 at"
                f" {self._rank_lost} of {self._rows} ticks: no currents are commanded there"
            )
        share = self.value() or 0.0
        if share > SATURATED_SHARE:
            warnings.append(
                f"the current limit reduced the torque at {100 * share:.0f} % of the ticks: the figures"
                " depend more on the limit than on the law"
            )
        return warnings


class MaxAbsError(Metric):
    """Largest ``|error_rad|`` of each hinge over the whole run, its start included, [3] in rad."""

    labels = ANGLES

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        self._largest = np.full(3, -np.inf)

    def add(self, rows: Table) -> None:
        """Process the rows of one chunk."""
        self._largest = np.maximum(self._largest, np.abs(rows["error_rad"]).max(axis=0))

    def value(self) -> list[float] | None:
        """Return [3] in rad; None without a row."""
        return self._largest.tolist() if self._largest[0] >= 0 else None


PIECE_TICKS = 256


class RmsError(Metric):
    """Root mean square of ``error_rad`` of each hinge over the whole run, [3] in rad."""

    labels = ANGLES

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        self._squares = SquaresByPiece(planned.ticks)

    def add(self, rows: Table) -> None:
        """Process the rows of one chunk."""
        self._squares.add(rows["error_rad"])

    def value(self) -> list[float] | None:
        """Return [3] in rad; None without a row."""
        return self._squares.rms(0)


class SquaresByPiece:
    """Sums of squares over pieces of 256 ticks, one of which begins at half of the planned ticks.

    They give the value of the second half without the rows, and grow by a kilobyte for 10,000 ticks.

    Parameters
    ----------
    planned : int
        Planned ticks of the run.
    """

    def __init__(self, planned: int) -> None:
        self._offset = planned // 2 % PIECE_TICKS
        self._sums = np.zeros((1, 3))
        self.rows = 0

    def add(self, values: NDArray[np.float64]) -> None:
        """Add the next rows (n, 3)."""
        first, squares = self.rows, values**2
        self.rows += len(values)
        last_piece = self.piece(self.rows - 1)
        missing = max(0, last_piece + 1 - len(self._sums))
        self._sums = np.concatenate([self._sums, np.zeros((missing, 3))])
        for piece in range(self.piece(first), last_piece + 1):
            begins = self._first_tick(piece) - first
            add_rows(squares[max(begins, 0) : max(begins + PIECE_TICKS, 0)], self._sums[piece])

    def rms(self, first: int) -> list[float] | None:
        """Return the root mean square from the first tick of a piece on; None without a row."""
        if not self.rows:
            return None
        begins = max(0, self._first_tick(first))
        return np.sqrt(self._sums[first:].sum(axis=0) / (self.rows - begins)).tolist()

    def _first_tick(self, piece: int) -> int:
        """Return the first tick of a piece; below 0 for the first piece, which is shorter."""
        return (piece - 1) * PIECE_TICKS + self._offset

    def piece(self, tick: int) -> int:
        """Return the piece that contains a tick."""
        return (tick - self._offset) // PIECE_TICKS + 1


BAND_rad = 0.01
"""Settling band of every hinge: the usual 5 % of 0.2 rad, the amplitude of the shipped motions."""


class SettlingTime(Metric):
    """Time from which ``|error_rad|`` of each hinge stays within 0.01 rad to the end, [3] in s.

    0 for a hinge that never leaves the band, None for a hinge that is outside at the last tick. A change
    during the run affects the time only through the error.
    """

    labels = ANGLES

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        self._last_outside = np.full(3, -1)

    def add(self, rows: Table) -> None:
        """Process the rows of one chunk."""
        outside = np.abs(rows["error_rad"]) > BAND_rad
        last = self._rows + len(rows) - 1 - np.argmax(outside[::-1], axis=0)
        self._last_outside = np.where(outside.any(axis=0), last, self._last_outside)

    def value(self) -> list[float | None] | None:
        """Return [3] in s; None without a row."""
        if not self._rows:
            return None
        settled = (self._last_outside + 1).tolist()
        return [tick * self.planned.period_s if tick < self._rows else None for tick in settled]


class Overshoot(Metric):
    """Largest ``error_rad`` of each hinge with the sign opposite to that of the initial error, [3] in rad.

    0 for a hinge that never crosses its reference, None for a hinge that begins within 0.01 rad of it, the
    settling band: without a step there is no overshoot.
    """

    labels = ANGLES

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        self._start, self._largest = np.zeros(3), np.zeros(3)

    def add(self, rows: Table) -> None:
        """Process the rows of one chunk."""
        error = rows["error_rad"]
        if not self._rows:
            self._start = error[0].copy()
        self._largest = np.maximum(self._largest, (-np.sign(self._start) * error).max(axis=0))

    def value(self) -> list[float | None] | None:
        """Return [3] in rad; None without a row."""
        if not self._rows:
            return None
        steps = np.abs(self._start) > BAND_rad
        return [float(largest) if step else None for largest, step in zip(self._largest, steps, strict=True)]


class TailRmsError(RmsError):
    """Root mean square of ``error_rad`` of each hinge over the second half of the run, [3] in rad.

    The second half begins at exactly half of the planned ticks, and in a run that ended early within 256
    ticks before its half.
    """

    def value(self) -> list[float] | None:
        """Return [3] in rad; None without a row."""
        return self._squares.rms(self._squares.piece(self._squares.rows // 2))


class RotorTemperature(Metric):
    """Largest temperature of the magnets, °C, which only decides about a warning."""

    def __init__(self, planned: PlannedRun) -> None:
        super().__init__(planned)
        self._section, self._largest = planned.scenario.plant.thermal, -np.inf

    def add(self, rows: Table) -> None:
        """Process the rows of one chunk."""
        if any(signal.name == "rotor_temperature_degC" for signal in rows.signals):
            self._largest = max(self._largest, float(rows["rotor_temperature_degC"].max()))

    def value(self) -> float | None:
        """Return the temperature in °C; None without one."""
        return self._largest if self._largest > -np.inf else None

    def warnings(self) -> list[str]:
        """Return a warning if magnets may have been demagnetised, which the model does not contain."""
        if not self._largest > self._section.knee_degC:
            return []
        return [
            f"the magnets reached {self._largest:.1f} °C, above plant.thermal.knee_degC"
            f" {self._section.knee_degC:g} °C: a lasting loss of remanence is possible and not simulated"
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
