"""Backstepping sliding mode: its equations, and its Lyapunov function on the coupled rotor."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.laws.backstepping_sliding_mode import BacksteppingSlidingMode
from spheretwin.models.lagrangian import coriolis_matrix, inertia_matrix
from spheretwin.simulation import simulate
from tests.control.laws.cases import PERIOD, UNDISTURBED, SlowIntegral, follows, known


class Slow(SlowIntegral):
    """The law as its docstring has it, as matrices."""

    def __call__(self, reference, measurement):
        slope, h, beta, layer, rate = self.named(
            "surface_slope", "reaching_gain", "switching", "layer", "adaptation_rate"
        )
        q, qdot, believed = measurement
        e, e_rate = q - reference[0], qdot - reference[1]
        s = e_rate + slope * e
        tracking = np.sqrt(slope * rate / (slope + h))
        self.integral += PERIOD * tracking * (believed - self.asked())
        torque = inertia_matrix(q, self.J) @ (reference[2] - slope * e_rate)
        torque += coriolis_matrix(q, qdot, self.J) @ (reference[1] - slope * e)
        torque += self.integral - self.J * h * (s + beta * np.clip(s / layer, -1, 1))
        self.integral -= PERIOD * self.J * rate * s
        self.asked.all.append(torque)
        return torque, np.concatenate([s, self.integral])


@pytest.mark.parametrize("delay_s", [0.0, 2.25e-3])
def test_law_follows_its_equations(actuator, delay_s):
    gains = BacksteppingSlidingMode(
        surface_slope=[40.0, 20.0, 60.0],
        reaching_gain=[50.0, 30.0, 10.0],
        switching=[0.05, 0.0, 0.5],
        layer=[0.1, 1.0, 3.0],
        adaptation_rate=[1600.0, 100.0, 0.0],
    )
    follows(gains.build(known(actuator, delay_s)), Slow(gains, actuator.inertia, delay_s))


LOADED = UNDISTURBED | {
    "plant.initial_rad": [0.01, -0.01, 0.02], "disturbance.load": 1.0, "duration": 0.3,
    "nominal.equals_truth": True, "controller.law": "backstepping_sliding_mode",
}  # fmt: skip


def course(period_s, actuator):
    """V of the docstring along a loaded nutation without model error, and what its decrease is said to be."""
    run = simulate(scenarios.load("nutation", LOADED | {"controller.period_s": period_s}))
    assert run.telemetry["allocation_scale"].min() == 1.0
    g, J, telemetry = run.scenario.controller, actuator.inertia, run.telemetry
    slope, h, rate = g.surface_slope[0], g.reaching_gain[0], g.adaptation_rate[0]
    s, e = telemetry["sliding_s"], telemetry["error_rad"]
    # What is logged has been moved on by this tick already.
    off = telemetry["adapted_torque_Nm"] + period_s * rate * J * s - telemetry["disturbance_Nm"]
    w = 2 * slope * h
    kinetic = [s_k @ inertia_matrix(q, J) @ s_k for q, s_k in zip(telemetry["q_rad"], s, strict=True)]
    V = 0.5 * (np.array(kinetic) + w * (J * e**2).sum(1) + (off**2 / (J * rate)).sum(1))
    switched = g.switching[0] * np.abs(s) * np.minimum(1, np.abs(s) / g.layer[0])
    decrease = (J * (h * (s**2 + switched) - w * e * s + w * slope * e**2)).sum(1)
    return V, decrease


def test_the_lyapunov_function_falls_as_derived(actuator):
    """On the rotor with all its coupling, spinning and loaded; to the first order in the period."""
    missed = []
    for period_s in (1e-3, 2.5e-4):
        V, decrease = course(period_s, actuator)
        assert np.all(decrease >= 0)
        fallen = -np.diff(V) / period_s
        mean = 0.5 * (decrease[1:] + decrease[:-1])
        missed.append(np.abs(fallen - mean).max() / decrease.max())
        # It rises by no more than what one period's hold is worth.
        assert np.diff(V).max() < 0.2 * period_s * decrease.max()
        assert V[-1] < 1e-3 * V[0]
    assert missed[1] < 0.05
    assert missed[0] / missed[1] == pytest.approx(4.0, rel=0.4)
