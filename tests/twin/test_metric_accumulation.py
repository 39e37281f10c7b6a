"""Sums and extremes of metrics compared with NumPy's arithmetic, to the last bit, in any chunks."""

import numpy as np
import pytest

from spheretwin import metrics
from spheretwin import scenario as scenarios
from spheretwin.metrics import BAND_rad, PlannedRun, SquaresByPiece
from spheretwin.models import actuator as actuators
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.table import Table

ROWS = np.random.default_rng(0).normal(size=(1000, 3)) * 10.0 ** np.array([-6, -2, 2])
SIZES = pytest.mark.parametrize("size", [1, 7, 1000])


def in_turn(rows, start):
    """Sum of rows, one after the other."""
    total = start.copy()
    for row in rows:
        total = total + row
    return total


def chunks(size):
    return [ROWS[first : first + size] for first in range(0, len(ROWS), size)]


def value(kind, column, size, session_scenario):
    planned = PlannedRun(session_scenario, actuators.load(), len(ROWS))
    metric = kind(planned)
    for rows in chunks(size):
        metric.write(Table((Signal(column, "1", 3, "values"),), rows))
    return metric.value()


@pytest.fixture(scope="module")
def scenario():
    return scenarios.load("hold", {"controller.period_s": 1e-3})


@SIZES
def test_sums_round_at_every_row_and_nowhere_else(size):
    start = np.linspace(0.1, 0.5, 3)
    total = start.copy()
    for rows in chunks(size):
        metrics.add_rows(rows, total)
    np.testing.assert_array_equal(total, in_turn(ROWS, start))


@SIZES
@pytest.mark.parametrize("planned", [0, 200, 1000, 1030])
def test_pieces_are_separate_sums(size, planned):
    squares, half = SquaresByPiece(planned), planned // 2
    for rows in chunks(size):
        squares.add(rows)
    starts = [tick for tick in range(half % 256, len(ROWS), 256) if tick]
    for piece, first in enumerate([0, *starts], start=squares.piece(0)):
        sums = [in_turn(part, np.zeros(3)) for part in np.split(ROWS**2, starts)[piece - squares.piece(0) :]]
        expected = np.sqrt(np.array(sums).sum(axis=0) / (len(ROWS) - first))
        np.testing.assert_array_equal(squares.rms(piece), expected)


@SIZES
def test_torque_is_the_root_of_the_mean_sum_of_squares(size, scenario):
    expected = float(np.sqrt(in_turn(ROWS**2, np.zeros(3)).sum() / len(ROWS)))
    assert value(metrics.RmsTorque, "torque_Nm", size, scenario) == expected


@SIZES
def test_the_largest_error_is_that_of_all_rows(size, scenario):
    assert value(metrics.MaxAbsError, "error_rad", size, scenario) == np.abs(ROWS).max(axis=0).tolist()


@SIZES
def test_settling_counts_from_the_last_row_outside_the_band(size, scenario):
    outside = [np.flatnonzero(np.abs(column) > BAND_rad) for column in ROWS.T]
    after = [int(places[-1]) + 1 if len(places) else 0 for places in outside]
    expected = [tick * scenario.controller.period_s if tick < len(ROWS) else None for tick in after]
    assert value(metrics.SettlingTime, "error_rad", size, scenario) == expected
    assert after[0] == 0 < after[1]


@SIZES
def test_overshoot_is_the_farthest_beyond_the_reference(size, scenario):
    farthest = np.maximum((-np.sign(ROWS[0]) * ROWS).max(axis=0), 0.0)
    expected = [
        float(far) if abs(first) > BAND_rad else None for far, first in zip(farthest, ROWS[0], strict=True)
    ]
    assert value(metrics.Overshoot, "error_rad", size, scenario) == expected
