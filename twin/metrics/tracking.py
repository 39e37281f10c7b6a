"""Metrics of the tracking error of a run: largest, mean square, settling time, overshoot."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from spheretwin.metrics.reduction import Metric, PlannedRun
from spheretwin.models.base.arrays import Array, Integers
from spheretwin.models.base.compiled import rounding_each
from spheretwin.models.telemetry.signals import ANGLES


@rounding_each
def add_largest(rows: Array, first: int, columns: tuple[int, ...], largest: Array, run: int) -> None:
    """Update the largest magnitudes (runs, n) of a signal."""
    (signal,) = columns
    for i in range(rows.shape[0]):
        for j in range(largest.shape[1]):
            largest[run, j] = max(largest[run, j], abs(rows[i, signal + j]))


class MaxAbsError(Metric):
    """Largest ``|error_rad|`` of each hinge over the whole run, its start included, [3] in rad."""

    labels = ANGLES
    reads = ("error_rad",)
    add = staticmethod(add_largest)

    def start(self, planned: PlannedRun) -> Array:
        """Return the largest magnitudes (runs, 3), minus infinity before the first row."""
        return np.full((planned.runs, 3), -np.inf)

    def results(self, rows: Integers) -> list[list[float]]:
        """Return [3] in rad of each run."""
        return self.state.tolist()


PIECE_TICKS = 256


class PieceSums(NamedTuple):
    """Sums of squares over pieces of 256 ticks, one of which begins at half of the planned ticks.

    They give the value of the second half without the rows, and grow by a kilobyte for 10,000 ticks.
    """

    offset: int  # ticks of the first piece, which may be shorter
    sums: Array  # (runs, pieces, 3) rad²


@rounding_each
def _add_pieces(rows: Array, first: int, columns: tuple[int, ...], state: PieceSums, run: int) -> None:
    (error,) = columns
    for i in range(rows.shape[0]):
        piece = (first + i - state.offset) // PIECE_TICKS + 1
        for j in range(3):
            state.sums[run, piece, j] += rows[i, error + j] * rows[i, error + j]


class RmsError(Metric):
    """Root mean square of ``error_rad`` of each hinge over the whole run, [3] in rad."""

    labels = ANGLES
    state: PieceSums
    reads = ("error_rad",)
    add = staticmethod(_add_pieces)

    def start(self, planned: PlannedRun) -> PieceSums:
        """Return the first piece."""
        return PieceSums(planned.ticks // 2 % PIECE_TICKS, np.zeros((planned.runs, 1, 3)))

    def reserve(self, ticks: int) -> None:
        """Extend the states to a number of ticks."""
        if (missing := self._piece(ticks - 1) + 1 - self.state.sums.shape[1]) > 0:
            more = np.zeros((len(self.rows), missing, 3))
            self.state = self.state._replace(sums=np.concatenate([self.state.sums, more], axis=1))

    def results(self, rows: Integers) -> list[list[float]]:
        """Return [3] in rad of each run."""
        return self._rms(rows, np.zeros_like(rows))

    def _rms(self, rows: Integers, first: Integers) -> list[list[float]]:
        """Return the root mean square of each run from the first tick of a piece on."""
        begins = np.maximum(0, (first - 1) * PIECE_TICKS + self.state.offset)
        squares = np.empty((len(rows), 3))
        for piece in set(first.tolist()):
            squares[first == piece] = self.state.sums[first == piece, piece:].sum(axis=1)
        return np.sqrt(squares / (rows - begins)[:, None]).tolist()

    def _piece(self, tick: Any) -> Any:
        """Return the piece that contains a tick, or each of many."""
        return (tick - self.state.offset) // PIECE_TICKS + 1


class TailRmsError(RmsError):
    """Root mean square of ``error_rad`` of each hinge over the second half of the run, [3] in rad.

    The second half begins at exactly half of the planned ticks, and in a run that ended early within 256
    ticks before its half.
    """

    def results(self, rows: Integers) -> list[list[float]]:
        """Return [3] in rad of each run."""
        return self._rms(rows, self._piece(rows // 2))


BAND_rad = 0.01
"""Settling band of every hinge: the usual 5 % of 0.2 rad, the amplitude of the shipped motions."""


@rounding_each
def _add_outside(rows: Array, first: int, columns: tuple[int, ...], last: Integers, run: int) -> None:
    (error,) = columns
    for i in range(rows.shape[0]):
        for j in range(3):
            if abs(rows[i, error + j]) > BAND_rad:
                last[run, j] = first + i


class SettlingTime(Metric):
    """Time from which ``|error_rad|`` of each hinge stays within 0.01 rad to the end, [3] in s.

    0 for a hinge that never leaves the band, None for a hinge that is outside at the last tick. A change
    during the run affects the time only through the error.
    """

    labels = ANGLES
    reads = ("error_rad",)
    add = staticmethod(_add_outside)

    def start(self, planned: PlannedRun) -> Integers:
        """Return the last tick of each hinge outside the band (runs, 3); -1 for none."""
        return np.full((planned.runs, 3), -1)

    def results(self, rows: Integers) -> list[list[float | None]]:
        """Return [3] in s of each run."""
        period_s, settled = self.planned.period_s, (self.state + 1).tolist()
        return [
            [tick * period_s if tick < of else None for tick in ticks]
            for ticks, of in zip(settled, rows.tolist(), strict=True)
        ]


@rounding_each
def _add_crossing(rows: Array, first: int, columns: tuple[int, ...], state: Array, run: int) -> None:
    (error,) = columns
    for i in range(rows.shape[0]):
        for j in range(3):
            if first + i == 0:
                state[run, 0, j] = rows[i, error + j]
            beyond = -rows[i, error + j] if state[run, 0, j] > 0.0 else rows[i, error + j]
            state[run, 1, j] = max(state[run, 1, j], beyond)


class Overshoot(Metric):
    """Largest ``error_rad`` of each hinge with the sign opposite to that of the initial error, [3] in rad.

    0 for a hinge that never crosses its reference, None for a hinge that begins within 0.01 rad of it, the
    settling band: without a step there is no overshoot.
    """

    labels = ANGLES
    reads = ("error_rad",)
    add = staticmethod(_add_crossing)

    def start(self, planned: PlannedRun) -> Array:
        """Return the error at the first tick and the largest beyond the reference, (runs, 2, 3) in rad."""
        return np.zeros((planned.runs, 2, 3))

    def results(self, rows: Integers) -> list[list[float | None]]:
        """Return [3] in rad of each run."""
        return [
            [beyond if abs(error) > BAND_rad else None for error, beyond in zip(start, largest, strict=True)]
            for start, largest in self.state.tolist()
        ]
