"""The root mean square of the tracking error, from squares that are summed piece by piece of the run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.table import Table
from spheretwin.twin.metrics.metric import Metric, Planned
from spheretwin.twin.metrics.reducing import add_squares_by_piece

PIECE_TICKS = 256


class RmsError(Metric):
    """Root mean square of ``error_rad`` of each hinge over the whole run, [3] in rad."""

    labels = ANGLES

    def __init__(self, planned: Planned) -> None:
        super().__init__(planned)
        self._squares = SquaresByPiece(planned.ticks)

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, at least one."""
        self._squares.add(rows["error_rad"])

    def value(self) -> list[float] | None:
        """[3] in rad; None without a row."""
        return self._squares.rms(0)


class SquaresByPiece:
    """Sums of squares over pieces of 256 ticks, one of which begins at half of the planned ticks.

    A second half can be told from them without the rows; they grow by a kilobyte for 10,000 ticks.

    Parameters
    ----------
    planned : int
        Ticks that the run is to have.
    """

    def __init__(self, planned: int) -> None:
        self._offset = planned // 2 % PIECE_TICKS
        self._sums = np.zeros((1, 3))
        self.rows = 0

    def add(self, values: NDArray[np.float64]) -> None:
        """Take the next rows (n, 3)."""
        first = self.rows - self._offset + PIECE_TICKS  # from the start of piece 0
        missing = max(0, self.piece(self.rows + len(values) - 1) + 1 - len(self._sums))
        self._sums = np.concatenate([self._sums, np.zeros((missing, 3))])
        add_squares_by_piece(np.ascontiguousarray(values), first, PIECE_TICKS, self._sums)
        self.rows += len(values)

    def rms(self, first: int) -> list[float] | None:
        """Root mean square from the first tick of a piece on; None where there is no row."""
        if not self.rows:
            return None
        begins = max(0, (first - 1) * PIECE_TICKS + self._offset)
        return np.sqrt(self._sums[first:].sum(axis=0) / (self.rows - begins)).tolist()

    def piece(self, tick: int) -> int:
        """Piece that a tick is in."""
        return (tick - self._offset) // PIECE_TICKS + 1
