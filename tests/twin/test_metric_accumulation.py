"""Sums and extremes of metrics compared with NumPy's arithmetic, to the last bit."""

import numpy as np
import pytest

from spheretwin import metrics
from spheretwin import scenario as scenarios
from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.signals import Signal, common_signals, width
from spheretwin.models.telemetry.table import Table
from spheretwin.reduction import PlannedRun
from spheretwin.session import Session

ROWS = np.random.default_rng(0).normal(size=(1000, 3)) * 10.0 ** np.array([-6, -2, 2])


def in_turn(rows, start):
    """Sum of rows, one after the other."""
    total = start.copy()
    for row in rows:
        total = total + row
    return total


def metric_of(kind, signals, rows, scenario, ticks=1000):
    """A metric that has processed rows in chunks of 7."""
    metric = kind(PlannedRun(scenario, actuators.load(), ticks))
    for first in range(0, len(rows), 7):
        metric.write(Table(signals, rows[first : first + 7]))
    return metric.value()


@pytest.fixture(scope="module")
def scenario():
    return scenarios.load("hold", {"controller.period_s": 1e-3})


@pytest.mark.parametrize("planned", [0, 200, 1000, 1030])
def test_pieces_are_separate_sums(planned, scenario):
    starts = [0, *(tick for tick in range(planned // 2 % 256, len(ROWS), 256) if tick)]
    sums = np.array([in_turn(part, np.zeros(3)) for part in np.split(ROWS**2, starts[1:])])
    of_tail = np.searchsorted(starts, len(ROWS) // 2, side="right") - 1
    signals = (Signal("error_rad", "rad", 3, "values"),)
    for kind, first in ((metrics.RmsError, 0), (metrics.TailRmsError, of_tail)):
        expected = np.sqrt(sums[first:].sum(axis=0) / (len(ROWS) - starts[first]))
        np.testing.assert_array_equal(metric_of(kind, signals, ROWS, scenario, planned), expected)


def test_torque_is_the_root_of_the_mean_sum_of_squares(scenario):
    signals = (Signal("torque_Nm", "N·m", 3, "values"),)
    expected = float(np.sqrt(in_turn(ROWS**2, np.zeros(3)).sum() / len(ROWS)))
    assert metric_of(metrics.RmsTorque, signals, ROWS, scenario) == expected


def test_logged_losses_are_added_in_turn(scenario):
    groups = len(actuators.load().groups)
    losses, common = np.random.default_rng(1).random((200, groups)), common_signals(groups)
    signals = (*common, Signal("copper_loss_W", "W", groups, "losses"))
    rows = np.hstack([np.zeros((200, width(common))), losses])
    expected = float(in_turn(losses, np.zeros(groups)).sum() * scenario.controller.period_s)
    assert metric_of(metrics.CopperLoss, signals, rows, Session(scenario).scenario, 200) == expected


def test_rows_without_a_signal_or_of_another_actuator_are_refused(scenario):
    metric = metrics.MaxAbsCurrent(PlannedRun(scenario, actuators.load(), 10))
    with pytest.raises(InputError, match="expected telemetry with 18 columns of current_A, received none"):
        metric.write(Table((Signal("error_rad", "rad", 3, "errors"),), ROWS))
    with pytest.raises(InputError, match="expected telemetry with 18 columns of current_A, received 3"):
        metric.write(Table((Signal("current_A", "A", 3, "currents"),), ROWS))
