"""Columns that not every run has: there where their stage acts, and what they hold."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.session import Session
from spheretwin.simulation import simulate


def run(changes):
    return simulate(scenarios.load("hold", {"duration": 0.05, **changes})).telemetry


LOGGED = [
    ("q_measured_rad", {"sensors.angle_offset_rad": [0.0, 0.0, 0.0]}, False),
    *(
        ("q_measured_rad", {"sensors.angle_offset_rad": offset}, True)
        for offset in (1e-6 * np.eye(3)).tolist()
    ),
    ("qdot_estimated_rad_s", {"sensors.angle_offset_rad": [1e-6, 0.0, 0.0]}, True),
    ("q_measured_rad", {"fault": [{"target": "coil.03", "mode": "open"}]}, False),
    ("friction_Nm", {"plant.coulomb_Nm": [0.0] * 3, "plant.viscous_Nm_s": [0.0] * 3}, False),
    ("friction_Nm", {"plant.coulomb_Nm": [0.0, 0.0, 1e-9]}, True),
    ("friction_Nm", {"plant.viscous_Nm_s": [0.0, 0.0, 1e-9]}, True),
    ("supply_power_W", {}, False),
    ("supply_power_W", {"hardware": "electronics"}, True),
    ("current_measured_A", {}, False),
    ("current_measured_A", {"detector.detect": True}, True),
]


@pytest.mark.parametrize(("name", "changes", "logged"), LOGGED)
def test_columns_of_a_stage_are_there_where_it_acts(name, changes, logged):
    with Session(scenarios.load("hold", changes)) as session:
        assert (name in {signal.name for signal in session.signals}) == logged


LAG = {"drive.time_constant_s": 4e-4, "plant.step_s": 2.5e-4}


def lagged_currents(command, time_constant_s, period_s):
    """Currents (n + 1, k) at the ticks and their means (n, k), of commands (n, k) that are held: `di/dt`."""
    left = np.exp(-period_s / time_constant_s)
    current, means = [np.zeros(command.shape[1])], []
    for target in command:
        distance = current[-1] - target
        means.append(target + time_constant_s / period_s * (1 - left) * distance)
        current.append(target + left * distance)
    return np.array(current), np.array(means)


def test_the_mean_current_is_that_of_all_physics_steps_of_the_tick():
    """Against the exact solution of a first-order lag over the whole tick, which has four steps."""
    table = run(LAG)
    command = table["current_command_A"]
    start, mean = lagged_currents(command, 4e-4, 1e-3)
    # Sums of a few currents of at most 8 A.
    np.testing.assert_allclose(table["mean_current_A"], mean, rtol=0, atol=1e-13)
    share = 4e-4 / 2.5e-4 * (1 - np.exp(-2.5e-4 / 4e-4))  # of what is left, over the first step
    expected = command + share * (start[:-1] - command)
    np.testing.assert_allclose(table["current_A"], expected, rtol=0, atol=1e-13)
    assert np.abs(table["mean_current_A"] - table["current_A"]).max() > 0.1
    one_step = run({**LAG, "plant.step_s": 1e-3})
    np.testing.assert_array_equal(one_step["mean_current_A"], one_step["current_A"])


def test_the_mean_current_of_a_tick_that_is_cut_short_is_that_of_the_steps_taken():
    """The rotor leaves its workspace in the first of ten physics steps."""
    limit = np.radians(80)
    changes = {
        "plant.step_s": 1e-4, "plant.initial_rad": [0.0, limit - 1e-5, 0.0],
        "plant.initial_rad_s": [0.0, 1.0, 0.0],
    }  # fmt: skip
    table = run(changes)
    assert len(table) == 1
    np.testing.assert_array_equal(table["mean_current_A"], table["current_A"])


def test_measured_currents_are_there_where_sensors_are_and_have_their_noise():
    noise_A = 0.05
    exact, noisy = run({**LAG, "detector.detect": True}), run({**LAG, "sensors.current.noise_A": noise_A})
    none, error = (
        run["current_measured_A"] - lagged_currents(run["current_command_A"], 4e-4, 1e-3)[0][:-1]
        for run in (exact, noisy)
    )
    np.testing.assert_allclose(none, 0, atol=1e-13)
    # Five standard errors of a standard deviation and of a mean of 900 numbers.
    assert abs(error.std() / noise_A - 1) < 5 / np.sqrt(2 * error.size)
    assert abs(error.mean()) < 5 * noise_A / np.sqrt(error.size)


@pytest.mark.parametrize(
    ("target", "mode", "value", "axis", "error_rad"),
    [
        ("pot.beta", "offset", 0.02, 1, 0.02),
        ("encoder.gamma", "offset", -0.03, 2, -0.03),
        # One volt of the potentiometer's 5 V across 300°.
        ("adc", "offset", 0.1, 0, 0.1 * np.radians(300) / 5),
    ],
)
def test_measured_angles_are_logged_where_only_a_fault_makes_them_differ(
    target, mode, value, axis, error_rad
):
    table = run({"fault": [{"target": target, "mode": mode, "value": value, "start_s": 0.02}]})
    error = table["q_measured_rad"] - table["q_rad"]
    assert not error[:20].any()
    # There and back between radians and volts: a few roundings.
    np.testing.assert_allclose(error[20:, axis], error_rad, rtol=0, atol=1e-15)
