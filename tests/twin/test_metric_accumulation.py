"""What metrics take from rows against NumPy's own arithmetic, to the last bit, in any chunks."""

import numpy as np
import pytest

from spheretwin import metrics

ROWS = np.random.default_rng(0).normal(size=(1000, 5)) * 10.0 ** np.arange(-6, 4, 2)


def in_turn(rows, start):
    """Sum of rows, one after the other."""
    total = start.copy()
    for row in rows:
        total = total + row
    return total


def chunks(size):
    return [ROWS[first : first + size] for first in range(0, len(ROWS), size)]


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_sums_round_at_every_row_and_nowhere_else(size):
    start = np.linspace(0.1, 0.5, 5)
    plain, squares = start.copy(), start.copy()
    for rows in chunks(size):
        metrics.add_rows(rows, plain)
        metrics.add_squares(rows, squares)
    np.testing.assert_array_equal(plain, in_turn(ROWS, start))
    np.testing.assert_array_equal(squares, in_turn(ROWS**2, start))


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_pieces_are_sums_of_their_own(size):
    sums, first = np.zeros((5, 5)), 100
    for rows in chunks(size):
        metrics.add_squares_by_piece(rows, first, 256, sums)
        first += len(rows)
    pieces = np.split(ROWS**2, [156, 412, 668, 924])
    np.testing.assert_array_equal(sums, [in_turn(piece, np.zeros(5)) for piece in pieces])


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_variation_goes_on_from_chunk_to_chunk(size):
    last, total = ROWS[0].copy(), np.zeros(5)
    for rows in chunks(size):
        metrics.add_variation(rows, last, total)
    np.testing.assert_array_equal(total, in_turn(np.abs(np.diff(ROWS, axis=0)), np.zeros(5)))
    np.testing.assert_array_equal(last, ROWS[-1])


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_largest_and_last_outside_are_those_of_all_rows(size):
    largest, last, first = np.full(5, -np.inf), np.full(5, -1), 0
    for rows in chunks(size):
        metrics.raise_to_largest(rows, largest)
        metrics.update_last_outside(rows, 1e-3, first, last)
        first += len(rows)
    np.testing.assert_array_equal(largest, np.abs(ROWS).max(axis=0))
    outside = [np.flatnonzero(np.abs(column) > 1e-3) for column in ROWS.T]
    assert last.tolist() == [places[-1] if len(places) else -1 for places in outside]
    assert last.min() == -1 < last.max()


def test_how_far_rows_go_in_a_direction():
    direction, farthest = np.array([1.0, -1.0, 0.0, 1.0, -1.0]), np.zeros(5)
    for rows in chunks(7):
        metrics.raise_to_farthest(rows, direction, farthest)
    np.testing.assert_array_equal(farthest, np.maximum((direction * ROWS).max(axis=0), 0.0))
