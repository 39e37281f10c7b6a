"""What metrics take from the rows of a chunk, in one pass each, one row after the other.

Every product and every sum is rounded by itself, in the order of the rows: the chunks do not show in it, and
NumPy's sum along the rows is the same to the last bit. It takes ten times as long, and the interpreter's lock
besides, which every thread of a study needs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import rounding_each

Array = NDArray[np.float64]


@rounding_each
def add_rows(rows: Array, total: Array) -> None:
    """Add rows (n, k) to a total (k,)."""
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            total[j] += rows[i, j]


@rounding_each
def add_squares(rows: Array, total: Array) -> None:
    """Add the squares of rows (n, k) to a total (k,)."""
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            total[j] += rows[i, j] * rows[i, j]


@rounding_each
def add_squares_by_piece(rows: Array, first: int, piece_rows: int, sums: Array) -> None:
    """Add the squares of rows (n, k) to the sums (pieces, k) of the pieces that they are in.

    Parameters
    ----------
    rows : (n, k) array
    first : int
        Place of the first row, counted from the start of the first piece.
    piece_rows : int
        Rows of a piece.
    sums : (pieces, k) array
        Added to.
    """
    for i in range(rows.shape[0]):
        piece = (first + i) // piece_rows
        for j in range(rows.shape[1]):
            sums[piece, j] += rows[i, j] * rows[i, j]


@rounding_each
def add_variation(rows: Array, last: Array, total: Array) -> None:
    """Add how far each column of rows (n, k) goes from row to row to a total (k,); `last` (k,) goes along."""
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            total[j] += abs(rows[i, j] - last[j])
            last[j] = rows[i, j]


@rounding_each
def raise_to_largest(rows: Array, largest: Array) -> None:
    """Raise `largest` (k,) to the largest magnitudes of rows (n, k)."""
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            largest[j] = max(largest[j], abs(rows[i, j]))


@rounding_each
def raise_to_farthest(rows: Array, direction: Array, farthest: Array) -> None:
    """Raise `farthest` (k,) to how far rows (n, k) go in a direction (k,), 1 or -1; 0 for none."""
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            farthest[j] = max(farthest[j], direction[j] * rows[i, j])


@rounding_each
def note_last_outside(rows: Array, band: float, first: int, last: NDArray[np.int64]) -> None:
    """Write into `last` (k,) where a magnitude of rows (n, k), counted from `first`, last leaves a band."""
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            if abs(rows[i, j]) > band:
                last[j] = first + i
