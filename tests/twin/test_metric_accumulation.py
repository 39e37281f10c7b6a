"""Sums and extremes of metrics compared with NumPy's arithmetic, to the last bit, in any chunks."""

import numpy as np
import pytest

from spheretwin import metrics
from spheretwin import scenario as scenarios
from spheretwin.metrics import BAND_rad
from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.signals import Signal, common_signals, width
from spheretwin.models.telemetry.table import Table
from spheretwin.reduction import PlannedRun
from spheretwin.session import Session

ROWS = np.random.default_rng(0).normal(size=(1000, 3)) * 10.0 ** np.array([-6, -2, 2])
SIZES = pytest.mark.parametrize("size", [1, 7, 1000])


def in_turn(rows, start):
    """Sum of rows, one after the other."""
    total = start.copy()
    for row in rows:
        total = total + row
    return total


def metric_of(kind, signal, rows, size, session_scenario, ticks=1000):
    """A metric that has processed rows in chunks of a size."""
    metric = kind(PlannedRun(session_scenario, actuators.load(), ticks))
    for first in range(0, len(rows), size):
        metric.write(Table((signal,), rows[first : first + size]))
    return metric


def value(kind, column, size, session_scenario):
    return metric_of(kind, Signal(column, "1", 3, "values"), ROWS, size, session_scenario).value()


@pytest.fixture(scope="module")
def scenario():
    return scenarios.load("hold", {"controller.period_s": 1e-3})


@SIZES
@pytest.mark.parametrize("planned", [0, 200, 1000, 1030])
def test_pieces_are_separate_sums(size, planned, scenario):
    starts = [0, *(tick for tick in range(planned // 2 % 256, len(ROWS), 256) if tick)]
    sums = np.array([in_turn(part, np.zeros(3)) for part in np.split(ROWS**2, starts[1:])])
    of_tail = np.searchsorted(starts, len(ROWS) // 2, side="right") - 1
    signal = Signal("error_rad", "rad", 3, "values")
    for kind, first in ((metrics.RmsError, 0), (metrics.TailRmsError, of_tail)):
        expected = np.sqrt(sums[first:].sum(axis=0) / (len(ROWS) - starts[first]))
        np.testing.assert_array_equal(
            metric_of(kind, signal, ROWS, size, scenario, planned).value(), expected
        )


@SIZES
def test_logged_losses_are_added_in_turn(size, scenario):
    groups = len(actuators.load().groups)
    rows = np.random.default_rng(1).random((200, groups))
    signal = Signal("copper_loss_W", "W", groups, "losses")
    common = common_signals(groups)
    metric = metrics.CopperLoss(PlannedRun(Session(scenario).scenario, actuators.load(), 200))
    for first in range(0, len(rows), size):
        part = rows[first : first + size]
        metric.write(Table((*common, signal), np.hstack([np.zeros((len(part), width(common))), part])))
    assert metric.value() == float(in_turn(rows, np.zeros(groups)).sum() * scenario.controller.period_s)


def test_rows_without_a_signal_or_of_another_actuator_are_refused(scenario):
    metric = metrics.MaxAbsCurrent(PlannedRun(scenario, actuators.load(), 10))
    with pytest.raises(InputError, match="expected telemetry with 18 columns of current_A, received none"):
        metric.write(Table((Signal("error_rad", "rad", 3, "errors"),), ROWS))
    with pytest.raises(InputError, match="expected telemetry with 18 columns of current_A, received 3"):
        metric.write(Table((Signal("current_A", "A", 3, "currents"),), ROWS))


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
