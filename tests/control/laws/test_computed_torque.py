"""Computed torque: exact cancellation of the model, and what a load leaves with and without an integral."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.laws.computed_torque import ComputedTorque
from spheretwin.models.lagrangian import coriolis_matrix, inertia_matrix
from spheretwin.simulation import simulate
from tests.control.laws.cases import PERIOD, Asked, follows, known


class Slow:
    """The law as its docstring has it, as matrices."""

    def __init__(self, gains, inertia, delay_s):
        self.gains, self.inertia, self.asked = gains, inertia, Asked(delay_s)
        self.integral = np.zeros(3)

    def __call__(self, reference, measurement):
        kp, kd, ki = (np.array(g) for g in (self.gains.stiffness, self.gains.damping, self.gains.integral))
        q, qdot, believed = measurement
        e, e_rate = q - reference[0], qdot - reference[1]
        M, C = inertia_matrix(q, self.inertia), coriolis_matrix(q, qdot, self.inertia)
        self.integral += PERIOD * np.sqrt(ki / kd) * (believed - self.asked())
        torque = M @ (reference[2] - kd * e_rate - kp * e) + C @ qdot + self.integral
        self.integral -= PERIOD * M @ (ki * e)
        self.asked.all.append(torque)
        return torque, self.integral


@pytest.mark.parametrize("delay_s", [0.0, 2.25e-3])
def test_law_follows_its_equations(actuator, delay_s):
    gains = ComputedTorque(stiffness=[4e3, 5e3, 1e3], damping=[100.0, 150.0, 80.0], integral=[6e4, 0.0, 9e3])
    follows(gains.build(known(actuator, delay_s)), Slow(gains, actuator.inertia, delay_s))


UNDISTURBED = {
    "plant.engine": "lagrangian",
    "plant.step_s": 2.5e-4,
    "plant.modelling_error": 0.0,
    "plant.modelling_torque_Nm": [0.0, 0.0, 0.0],
    "disturbance.load": 0.0,
    "disturbance.random_bound_Nm": 0.0,
    "drive.time_constant_s": 0.0,
    "controller.law": "computed_torque",
}
POLE = 20.0
TWO_POLES = {"controller.stiffness": POLE**2, "controller.damping": 2 * POLE, "controller.integral": 0.0}


def decay_missed(period_s):
    """How far the errors of a nutation are from (e₀ + (ė₀ + 20 e₀) t) e^(−20 t), rad."""
    start = {"plant.initial_rad": [0.02, -0.03, 0.05], "duration": 0.5, "controller.period_s": period_s}
    run = simulate(scenarios.load("nutation", {**UNDISTURBED, **TWO_POLES, **start}))
    t = run.telemetry["t_s"][:, None]
    e0 = run.telemetry["error_rad"][0]
    rate = run.telemetry["qdot_rad_s"][0] - run.telemetry["qdot_ref_rad_s"][0]
    exact = (e0 + (rate + POLE * e0) * t) * np.exp(-POLE * t)
    assert run.telemetry["allocation_scale"].min() == 1.0
    return np.abs(run.telemetry["error_rad"] - exact).max(), np.abs(exact).max()


def test_errors_of_an_undisturbed_nutation_decay_in_closed_form():
    """The axes are coupled and spin; each error is that of two poles alone, as ticks get short."""
    (coarse, size), (fine, _) = decay_missed(1e-3), decay_missed(2.5e-4)
    assert size > 0.05
    # A held torque is half a period late: by the pole times half a period times a few of the size.
    assert fine < 5 * POLE * 0.5 * 2.5e-4 * size
    assert coarse / fine == pytest.approx(4.0, rel=0.25)  # of first order


def held(**more):
    loaded = {"controller.law": "computed_torque", "disturbance.load": 1.0, "plant.engine": "lagrangian"}
    return simulate(scenarios.load("hold", loaded | more))


def test_a_constant_load_leaves_no_error_with_an_integral():
    run = held(**{"plant.payload_kg": 0.05})
    assert run.status == "completed"
    # After 3 s three poles at −40 have left (40·3)² e^(−40·3) of the start, 1e-48; the rest is rounding.
    assert np.abs(run.telemetry["error_rad"][-100:]).max() < 1e-14


def test_a_constant_load_leaves_its_share_of_the_stiffness_without(actuator):
    run = held(**TWO_POLES)
    q, load = run.telemetry["q_rad"][-1], run.telemetry["disturbance_Nm"][-1]
    left = np.linalg.solve(inertia_matrix(q, actuator.inertia), -load) / POLE**2
    assert np.abs(left).min() > 0.01
    # Two poles at −20 have left 60 e^(−60) of the start; the rest is rounding.
    np.testing.assert_allclose(run.telemetry["error_rad"][-1], left, rtol=1e-9)


def test_the_current_limit_holds_the_integral():
    weak = {"drive.current_limit_A": 2.0, "nominal.current_limit_A": 2.0, "disturbance.load": 0.0}
    run = held(**weak)
    assert run.status == "completed"
    assert run.telemetry["allocation_scale"].min() < 0.2
    start = run.telemetry["error_rad"][0]
    assert np.max(-np.sign(start) * run.telemetry["error_rad"] / np.abs(start)) < 0.5
