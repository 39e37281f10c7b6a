"""The prototype's sensors and drive in the loop: estimated rates, delay, supply, energy, heat, snapshots."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.estimators import ESTIMATORS
from spheretwin.control.estimators.estimator import estimates
from spheretwin.electronics.random_streams import noise_table
from spheretwin.electronics.sensor_chain import SensorChain, fill_sensors, noise_streams, sense
from spheretwin.loop import assembly
from spheretwin.models.lagrangian import inertia_matrix
from spheretwin.session import Session
from spheretwin.simulation import simulate

MADE = [kind for kind in ESTIMATORS if kind != "ideal"]
L_H = 0.9e-3


def prototype(name="hold", **changes):
    return scenarios.load(name, {"hardware": "electronics", "duration": 0.1, "seed": 5, **changes})


@pytest.mark.parametrize("kind", MADE)
def test_the_law_is_handed_what_the_stages_make_of_the_true_state(kind):
    """Sensors and estimator called one after the other, outside the loop, give the logged columns."""
    run = simulate(prototype("tilt", **{"estimator.kind": kind, "duration": 0.5}))
    table, resolved = run.telemetry, run.scenario
    chain = SensorChain.filled(fill_sensors, resolved.sensors, resolved.seed, delays=8)[0]
    noise = noise_table(resolved.seed, 0, len(table), noise_streams(resolved.sensors))
    measurement, angles = np.empty((3, 3)), np.empty((len(table), 3))
    for tick, (q, qdot) in enumerate(zip(table["q_rad"], table["qdot_rad_s"], strict=True)):
        sense(chain, q.copy(), qdot.copy(), noise[tick], np.zeros(0), measurement)
        angles[tick] = measurement[0]
    np.testing.assert_array_equal(table["q_measured_rad"], angles)
    rates = estimates(assembly.estimator_of(resolved), angles)
    # The same machine code, but for products and sums that are fused in one place and not in the other.
    np.testing.assert_allclose(table["qdot_estimated_rad_s"], rates, rtol=1e-9, atol=1e-9)
    assert np.abs(table["q_measured_rad"] - table["q_rad"]).max() > 1e-4


def test_nothing_flows_before_the_delay_is_over():
    quiet = {"drive.dac_offset_V": 0.0, "drive.amplifier_offset_V": 0.0, "drive.dac_inl_lsb": 0.0}
    table = simulate(prototype(**quiet, **{"drive.delay_s": 2.5e-3, "drive.dac_bits": 0})).telemetry
    assert np.abs(table["current_command_A"][0]).max() > 0.1
    np.testing.assert_array_equal(table["current_A"][:3], 0.0)  # the row of 2 ms is of its first half
    assert np.abs(table["current_A"][3]).max() > 0.1


def test_work_at_the_coils_is_heat_motion_and_field():
    """Energy: what goes into the coils is copper loss, the rotor's kinetic energy, and ½ L i²."""
    still = {
        "disturbance.load": 0.0, "drive.resistance_per_K": 0.0, "plant.modelling_error": 0.0,
        "drive.delay_s": 0.0, "plant.coulomb_Nm": [0.0] * 3, "plant.viscous_Nm_s": [0.0] * 3,
        "controller.law": "pd", "controller.stiffness": 400.0, "watchdog.on": False,
    }  # fmt: skip
    left = []
    for step_s in (5e-4, 2.5e-4, 1.25e-4):
        with Session(prototype(duration=0.06, **still, **{"plant.step_s": step_s})) as session:
            table, inertia = session.advance(60), session.actuator.inertia
            current = session._runtime.rows[0].plant.current
            q, qdot = session.q_rad, session._runtime.qdot_rad_s
            work = table["coil_power_W"].sum() * 1e-3
            heat = table["copper_loss_W"].sum() * 1e-3
            kinetic = 0.5 * qdot @ inertia_matrix(q, inertia) @ qdot
            field = 0.5 * L_H * float(np.sum(current**2))
        left.append(abs(work - heat - kinetic - field) / kinetic)
    # The EMF of the middle of a physics step is held over it: what is left is of second order in the step, or
    # smaller where the errors of its parts cancel.
    assert left[0] < 2e-4
    assert left[0] / left[1] > 3.8, left
    assert left[1] / left[2] > 3.8, left


def test_a_coil_too_hot_ends_the_run_safely_without_a_watchdog_too():
    run = simulate(prototype(**{"drive.shutdown_degC": 20.05, "duration": 3.0, "watchdog.on": False}))
    assert run.status == "failsafe"
    hottest = run.telemetry["coil_temperature_degC"].max(axis=1)
    assert hottest[-2] <= 20.05 < hottest[-1]


def test_neutral_stages_move_no_bit():
    neutral = {"delay_s": 0.0, "dac_bits": 0, "dac_offset_V": 1e-3, "bandwidth_rad_s": 10.0}
    changes = {f"drive.{name}": value for name, value in neutral.items()}
    both = (scenarios.load("hold", {"duration": 0.1, **each}) for each in ({}, changes))
    plain, named = (simulate(each).telemetry for each in both)
    assert named.values.tobytes() == plain.values.tobytes()
