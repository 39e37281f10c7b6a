"""Metrics of the tracking error of a run: largest, mean square, settling time, overshoot."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import rounding_each
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.reduction import Largest, Metric, PlannedRun

Array = NDArray[np.float64]


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
