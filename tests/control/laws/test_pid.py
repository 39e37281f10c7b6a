"""The PID law: its equations, its poles, and why its integral tracks the applied torque."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.law_components.feedback import triple_pole
from spheretwin.control.laws.pid import PID
from spheretwin.simulation import simulate
from tests.control.laws.cases import PERIOD, WEAK, SlowIntegral, follows, known


class Slow(SlowIntegral):
    """The law as its docstring has it."""

    def __call__(self, reference, measurement):
        kp, kd, ki = self.named("stiffness", "damping", "integral")
        e, e_rate = measurement[:2] - reference[:2]
        self.integral += PERIOD * np.sqrt(ki / kd) * (measurement[2] - self.asked())
        torque = self.integral - self.J * (kp * e + kd * e_rate)
        self.integral -= PERIOD * self.J * ki * e
        self.asked.all.append(torque)
        return torque, self.integral


@pytest.mark.parametrize("delay_s", [0.0, 1e-3, 2.25e-3])
def test_law_follows_its_equations(actuator, delay_s):
    gains = PID(stiffness=[4e3, 5e3, 1e3], damping=[100.0, 150.0, 80.0], integral=[6e4, 0.0, 9e3])
    follows(gains.build(known(actuator, delay_s)), Slow(gains, actuator.inertia, delay_s))


def test_closed_loop_poles_are_those_of_the_sampled_loop(actuator):
    """The matrix of one period of (angle, rate, integral) of β: the law on a double integrator."""
    kp, kd, ki, T = 4800.0, 120.0, 64000.0, PERIOD
    law = PID(stiffness=kp, damping=kd, integral=ki).build(known(actuator))
    columns = []
    for angle, rate, integral in np.eye(3):
        state, torque, measurement = law.state.copy(), np.empty(3), np.zeros((3, 3))
        state[1], measurement[:2, 1] = integral, (angle, rate)
        law.step(0.0, np.zeros((3, 3)), measurement, law.parameters, state, torque)
        push = torque[1] / actuator.inertia[1]
        columns.append([angle + T * rate + 0.5 * T**2 * push, rate + T * push, state[1]])
    # With d = z - 1: angle d² = T²/2 (d + 2) v, rate d = T v, integral d = -ki T angle.
    exact = [1, kd * T + kp * T**2 / 2, kp * T**2 + ki * T**3 / 2, ki * T**3]
    coefficients = np.poly(np.linalg.eigvals(np.transpose(columns) - np.eye(3)))
    # Eigenvalues that nearly coincide are known to the cube root of rounding; their polynomial is not.
    np.testing.assert_allclose(coefficients, exact, rtol=1e-9)


def test_the_default_is_a_triple_pole():
    gains = PID()
    bandwidth = gains.damping[0] / 3
    stiffness, damping, integral = triple_pole(bandwidth)
    np.testing.assert_allclose([1, damping, stiffness, integral], np.poly([-bandwidth] * 3), rtol=1e-14)
    assert gains == PID(stiffness=stiffness, damping=damping, integral=integral)


def test_without_tracking_the_integral_winds_up(monkeypatch):
    """A step that asks for more than the coils get: the rotor leaves the workspace."""
    build = PID.build

    def without_tracking(self, known):
        law = build(self, known)
        law.parameters[9:12] = 0.0
        return law

    monkeypatch.setattr(PID, "build", without_tracking)
    assert simulate(scenarios.load("hold", WEAK | {"controller.law": "pid"})).status == "left_workspace"
