"""Metrics against their plain definitions over the whole run, and their sums to the last bit."""

import numpy as np
import pytest

from spheretwin import metrics
from spheretwin import scenario as scenarios
from spheretwin.metrics import METRICS
from spheretwin.metrics.reduction import PlannedRun
from spheretwin.metrics.tracking import BAND_rad
from spheretwin.models import actuator as actuators
from spheretwin.models.telemetry.signals import Signal, common_signals, width
from spheretwin.models.telemetry.table import Table
from spheretwin.run import figures_of
from spheretwin.session import Session
from spheretwin.simulation import simulate


def plain_settling(run):
    error, t_s = np.abs(run.telemetry["error_rad"]), run.telemetry["t_s"]
    for axis in range(3):
        inside = [k for k in range(len(error)) if np.all(error[k:, axis] <= BAND_rad)]
        yield t_s[inside[0]] if inside else None


def plain_overshoot(run):
    for error in run.telemetry["error_rad"].T:
        past = error if error[0] < 0 else -error
        yield max(0.0, *past) if abs(error[0]) > BAND_rad else None


def plain_variation(run):
    command, t_s = run.telemetry["current_command_A"], run.telemetry["t_s"]
    up_and_down = [np.sum(np.abs(np.diff(command[:, group]))) for group in range(command.shape[1])]
    return np.sum(up_and_down) / len(up_and_down) / (t_s[-1] - t_s[0])


def plain_copper(run):
    """Currents carried from tick to tick, and the square of each integrated by Gauss's rule."""
    period_s, drive = run.scenario.controller.period_s, run.scenario.drive
    # 24 points are exact to rounding for a few time constants a tick; without a lag nothing is left.
    point, weight = np.polynomial.legendre.leggauss(24)
    t = np.append(0.5 * period_s * (1 + point), period_s)
    left = np.exp(-t / drive.time_constant_s) if drive.time_constant_s else np.zeros(25)
    current, squares = np.zeros(len(run.actuator.groups)), 0.0
    for command in run.telemetry["current_command_A"]:
        target = np.clip(command, -drive.current_limit_A, drive.current_limit_A)
        within = target + left[:, None] * (current - target)  # (25, groups)
        squares += 0.5 * period_s * np.sum(weight @ within[:-1] ** 2)
        current = within[-1]
    return run.actuator.group.resistance_ohm * squares


PLAIN = {
    "max_abs_error_rad": lambda run: np.abs(run.telemetry["error_rad"]).max(axis=0),
    "rms_error_rad": lambda run: np.sqrt(np.mean(run.telemetry["error_rad"] ** 2, axis=0)),
    "tail_rms_error_rad": lambda run: np.sqrt(
        np.mean(run.telemetry["error_rad"][run.scenario.ticks // 2 :] ** 2, axis=0)
    ),
    "settling_time_s": lambda run: list(plain_settling(run)),
    "overshoot_rad": lambda run: list(plain_overshoot(run)),
    "max_abs_current_A": lambda run: np.abs(run.telemetry["current_A"]).max(),
    "saturated_fraction": lambda run: np.mean(
        (run.telemetry["allocation_scale"] < 1) & (run.telemetry["allocation_scale"] > 0)
    ),
    "rms_torque_Nm": lambda run: np.sqrt(np.mean(np.linalg.norm(run.telemetry["torque_Nm"], axis=1) ** 2)),
    "current_variation_A_s": plain_variation,
    "copper_loss_J": plain_copper,
}


@pytest.fixture(scope="module")
def runs():
    """At the limit, at another rate and of an odd length, chattering, without lag, with small amplifiers."""
    fast = {"duration": 0.7777, "controller.period_s": 5e-4, "controller.law": "pd"}
    small = {"duration": 0.1, "drive.current_limit_A": 3.0, "drive.time_constant_s": 3e-3}
    return [
        simulate("nutation", {"duration": 1.3}),
        simulate("sinusoid", fast),
        simulate("hold", {"duration": 0.3}),
        simulate("tilt", {"duration": 0.1, "drive.time_constant_s": 0.0}),
        simulate("hold", small),
    ]


@pytest.mark.parametrize("name", PLAIN)
def test_each_is_its_plain_definition(runs, name):
    for run in runs:
        expected = np.asarray(PLAIN[name](run), dtype=float)  # None as NaN
        received = np.asarray(figures_of(run)[name], dtype=float)
        # Sums of some thousand squares in another order.
        np.testing.assert_allclose(received, expected, rtol=1e-12, atol=1e-15)


@pytest.fixture
def still():
    """One second of rows in which nothing happens, and what is planned."""
    session = Session(scenarios.load("hold", {"duration": 1.0}))
    table = Table(session.signals, np.zeros((1000, width(session.signals))))
    table["t_s"][:] = np.arange(1000) * 1e-3
    table["allocation_scale"][:] = 1.0
    return PlannedRun(session.scenario, session.actuator, 1000), table


def value(name, planned, table):
    metric = METRICS[name](planned)
    metric.write(table)
    return metric.values()[0]


def test_commands_of_one_row_have_no_variation(still):
    planned, table = still
    assert value("current_variation_A_s", planned, table.rows(0, 1)) is None


def test_settled_is_settled_for_good(still):
    planned, table = still
    table["error_rad"][:400, 0] = 2 * BAND_rad
    table["error_rad"][:400, 1] = BAND_rad  # on the border is inside
    table["error_rad"][[100, 700], 1] = -1.1 * BAND_rad
    table["error_rad"][-1, 2] = 2 * BAND_rad
    assert value("settling_time_s", planned, table) == [pytest.approx(0.4), pytest.approx(0.701), None]
    table["error_rad"][:] = 0
    assert value("settling_time_s", planned, table) == [0.0, 0.0, 0.0]


def test_only_what_is_past_the_reference_overshoots(still):
    planned, table = still
    table["error_rad"][:] = [-0.2, 0.2, 0.9 * BAND_rad]
    # The second comes near, the third had no step to overshoot.
    table["error_rad"][500:] = [0.03, 0.001, -0.1]
    assert value("overshoot_rad", planned, table) == [0.03, 0.0, None]


@pytest.mark.parametrize(("share", "lines"), [(0.05, 0), (0.051, 1)])
def test_a_run_at_the_limit_warns(still, share, lines):
    planned, table = still
    table["allocation_scale"][: round(1000 * share)] = 0.9
    metric = METRICS["saturated_fraction"](planned)
    metric.write(table)
    assert metric.values()[0] == share
    assert len(metric.warnings()) == lines


@pytest.mark.parametrize("allocation", ["least_norm", "bounded"])
def test_a_lost_rank_is_not_reported_as_the_current_limit(allocation):
    """Two groups cannot give torque in three directions."""
    fault = {"mode": "open", "start_s": 0.05, "reported_to_controller": True}
    faults = [fault | {"target": f"coil.{group:02d}"} for group in range(16)]
    run = simulate("nutation", {"duration": 0.1, "allocation": allocation, "fault": faults})
    lost = run.telemetry["allocation_scale"] == 0
    assert not lost[:50].any()
    assert lost[50:].all()
    assert not run.telemetry["current_command_A"][50:].any()
    metric = METRICS["saturated_fraction"](PlannedRun(run.scenario, run.actuator, run.scenario.ticks))
    metric.write(run.telemetry)
    assert metric.warnings()[0] == (
        "the torque matrix of the groups in use has less than rank 3 at 50 of 100 ticks:"
        " no currents are commanded there"
    )
    limited = np.mean((run.telemetry["allocation_scale"] < 1) & ~lost)
    assert metric.values()[0] == limited
    assert len(metric.warnings()) == 1 + (limited > 0.05)


# --- sums to the last bit

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
    return metric.values()[0]


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
