"""Computed torque: exact cancellation of the model, and what a load leaves without an integral."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.laws.computed_torque import ComputedTorque
from spheretwin.models.lagrangian import coriolis_matrix, inertia_matrix
from spheretwin.simulation import simulate
from tests.control.laws.cases import PERIOD, UNDISTURBED, SlowIntegral, follows, known


class Slow(SlowIntegral):
    """The law as its docstring has it, as matrices."""

    def __call__(self, reference, measurement):
        kp, kd, ki = self.named("stiffness", "damping", "integral")
        q, qdot, believed = measurement
        e, e_rate = q - reference[0], qdot - reference[1]
        M, C = inertia_matrix(q, self.J), coriolis_matrix(q, qdot, self.J)
        self.integral += PERIOD * np.sqrt(ki / kd) * (believed - self.asked())
        torque = M @ (reference[2] - kd * e_rate - kp * e) + C @ qdot + self.integral
        self.integral -= PERIOD * M @ (ki * e)
        self.asked.all.append(torque)
        return torque, self.integral


@pytest.mark.parametrize("delay_s", [0.0, 2.25e-3])
def test_law_follows_its_equations(actuator, delay_s):
    gains = ComputedTorque(stiffness=[4e3, 5e3, 1e3], damping=[100.0, 150.0, 80.0], integral=[6e4, 0.0, 9e3])
    follows(gains.build(known(actuator, delay_s)), Slow(gains, actuator.inertia, delay_s))


POLE = 20.0
TWO_POLES = {
    "controller.law": "computed_torque", "controller.stiffness": POLE**2, "controller.damping": 2 * POLE,
    "controller.integral": 0.0,
}  # fmt: skip


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


def test_without_an_integral_a_constant_load_leaves_its_share_of_the_stiffness(actuator):
    loaded = {"disturbance.load": 1.0, "plant.engine": "lagrangian"}
    run = simulate(scenarios.load("hold", loaded | TWO_POLES))
    q, load = run.telemetry["q_rad"][-1], run.telemetry["disturbance_Nm"][-1]
    left = np.linalg.solve(inertia_matrix(q, actuator.inertia), -load) / POLE**2
    assert np.abs(left).min() > 0.01
    # Two poles at −20 have left 60 e^(−60) of the start; the rest is rounding.
    np.testing.assert_allclose(run.telemetry["error_rad"][-1], left, rtol=1e-9)
