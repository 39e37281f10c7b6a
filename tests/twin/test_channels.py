"""Columns that not every run has: there where their stage acts, and what they hold."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.channels import CHANNELS
from spheretwin.models.telemetry.signals import common_signals
from spheretwin.simulation import simulate

# What makes each stage log.
LOGGED_BY = {
    "q_measured_rad": {"sensors.angle_offset_rad": [0.01, 0.0, -0.02]},
    "friction_Nm": {"plant.viscous_Nm_s": [1e-3, 1e-3, 1e-3]},
    "supply_power_W": {"drive.supply_V": 12.0, "drive.dac_bits": 16},
}
STAGES = [columns for columns in CHANNELS if columns.signals(18)[0].name in LOGGED_BY]


def run(changes):
    return simulate(scenarios.load("hold", {"duration": 0.05, **changes})).telemetry


@pytest.mark.parametrize("columns", STAGES, ids=list(LOGGED_BY))
def test_they_are_there_where_the_stage_acts_and_nowhere_else(columns):
    names = [signal.name for signal in columns.signals(18)]
    table = run(LOGGED_BY[names[0]])
    for name in names:
        assert np.isfinite(table[name]).all()
    assert table[names[0]].any()
    assert not set(names) & {signal.name for signal in run({}).signals}
    # They move no other column.
    others = [signal.name for signal in common_signals(18)]
    together = run({key: value for each in LOGGED_BY.values() for key, value in each.items()})
    assert set(names) <= {signal.name for signal in together.signals}
    assert [signal.name for signal in together.signals][: len(others)] == others


def test_each_holds_what_its_stage_did():
    changes = {key: value for each in LOGGED_BY.values() for key, value in each.items()}
    table = run(changes)
    offset = table["q_measured_rad"] - table["q_rad"]
    # A sum and a difference of numbers below 1: rounded twice.
    np.testing.assert_allclose(offset, np.tile([0.01, 0.0, -0.02], (50, 1)), rtol=0, atol=2.3e-16)
    np.testing.assert_array_equal(table["qdot_estimated_rad_s"], table["qdot_rad_s"])
    # The mean of viscous friction over the first of two physics steps: that of the rates a quarter of the
    # tick later, which change nearly evenly.
    rates = table["qdot_rad_s"][:-1] + 0.25 * np.diff(table["qdot_rad_s"], axis=0)
    np.testing.assert_allclose(table["friction_Nm"][:-1], -1e-3 * rates, rtol=0.1, atol=2e-5)


LAG = {"drive.time_constant_s": 4e-4, "plant.step_s": 2.5e-4, "plant.engine": "lagrangian"}


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
    _, mean = lagged_currents(table["current_command_A"], 4e-4, 1e-3)
    # Sums of a few currents of at most 8 A.
    np.testing.assert_allclose(table["mean_current_A"], mean, rtol=0, atol=1e-13)
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
    assert "current_measured_A" not in {signal.name for signal in run(LAG).signals}
    exact, noisy = run({**LAG, "detector.detect": True}), run({**LAG, "sensors.current.noise_A": noise_A})
    current, _ = lagged_currents(exact["current_command_A"], 4e-4, 1e-3)
    np.testing.assert_allclose(exact["current_measured_A"], current[:-1], rtol=0, atol=1e-13)
    current, _ = lagged_currents(noisy["current_command_A"], 4e-4, 1e-3)
    error = noisy["current_measured_A"] - current[:-1]
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


def test_measured_angles_are_not_logged_for_a_fault_of_the_drive():
    table = run({"fault": [{"target": "coil.03", "mode": "open"}]})
    assert "q_measured_rad" not in {signal.name for signal in table.signals}
