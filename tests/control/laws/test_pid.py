"""The PID law: its poles, no error under a constant load, and an integral that the current limit holds."""

from math import sqrt

import numba
import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.controller import law_at
from spheretwin.control.law import SIGNATURE, NominalModel
from spheretwin.control.law_components.feedback import triple_pole
from spheretwin.control.laws.pid import PID
from spheretwin.models.base.compiled import compiled_callback
from spheretwin.simulation import simulate

PERIOD = 1e-3


@numba.njit
def by_address(address, t, reference, measurement, parameters, state, torque):
    """Call a law as the loop does: its machine code."""
    law_at(address)(t, reference, measurement, parameters, state, torque)


class SlowPID:
    """The law as its docstring has it, one axis at a time; every torque that it ever asked for is kept."""

    def __init__(self, gains, inertia, delay_s):
        self.gains, self.inertia, self.delay = gains, inertia, delay_s / PERIOD
        self.integral, self.asked = np.zeros(3), [np.zeros(3)]

    def asked_before(self, periods):
        """What was asked so many periods before the last tick; nothing before the first."""
        return self.asked[-1 - periods] if periods < len(self.asked) else np.zeros(3)

    def torque(self, reference, measurement):
        e, e_rate = measurement[0] - reference[0], measurement[1] - reference[1]
        whole, late = divmod(self.delay, 1)
        asked = late * self.asked_before(int(whole) + 1) + (1 - late) * self.asked_before(int(whole))
        answer = np.empty(3)
        for i in range(3):
            kp, kd, ki = self.gains.stiffness[i], self.gains.damping[i], self.gains.integral[i]
            self.integral[i] += PERIOD * sqrt(ki / kd) * (measurement[2, i] - asked[i])
            answer[i] = self.integral[i] - self.inertia[i] * (kp * e[i] + kd * e_rate[i])
            self.integral[i] -= PERIOD * self.inertia[i] * ki * e[i]
        self.asked.append(answer.copy())
        return answer


@pytest.mark.parametrize("delay_s", [0.0, 1e-3, 2.25e-3])
def test_law_follows_its_equations(actuator, delay_s):
    gains = PID(stiffness=[4e3, 5e3, 1e3], damping=[100.0, 150.0, 80.0], integral=[6e4, 0.0, 9e3])
    law = gains.build(NominalModel(PERIOD, delay_s, actuator.inertia))
    slow = SlowPID(gains, actuator.inertia, delay_s)
    compiled = compiled_callback(SIGNATURE, law.step)
    generator = np.random.default_rng(0)
    state, torque = law.state.copy(), np.empty(3)
    for tick in range(300):
        reference, measurement = generator.normal(size=(3, 3)), generator.normal(size=(3, 3))
        by_address(compiled.address, PERIOD * tick, reference, measurement, law.parameters, state, torque)
        # Sums of 300 numbers: rounding of 1e-16 each.
        np.testing.assert_allclose(torque, slow.torque(reference, measurement), rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(state[:3], slow.integral, rtol=1e-12, atol=1e-12)


def closed_loop(gains, period_s, inertia):
    """Matrix of one control period of (angle, rate, integral) of β: the law on a double integrator."""
    law = gains.build(NominalModel(period_s, 0.0, inertia))
    columns = []
    for unit in np.eye(3):
        state, torque = law.state.copy(), np.empty(3)
        state[1] = unit[2]
        measurement = np.zeros((3, 3))
        measurement[:2, 1] = unit[:2]
        law.step(0.0, np.zeros((3, 3)), measurement, law.parameters, state, torque)
        push = torque[1] / inertia[1]
        angle = unit[0] + period_s * unit[1] + 0.5 * period_s**2 * push
        columns.append([angle, unit[1] + period_s * push, state[1]])
    return np.array(columns).T


def test_closed_loop_poles_are_those_of_the_sampled_loop(actuator):
    gains = PID(stiffness=4800.0, damping=120.0, integral=64000.0)
    kp, kd, ki, T = 4800.0, 120.0, 64000.0, PERIOD
    # With d = z - 1: angle d² = T²/2 (d + 2) v, rate d = T v, integral d = -ki T angle.
    exact = [1, kd * T + kp * T**2 / 2, kp * T**2 + ki * T**3 / 2, ki * T**3]
    coefficients = np.poly(np.linalg.eigvals(closed_loop(gains, PERIOD, actuator.inertia) - np.eye(3)))
    # Eigenvalues that nearly coincide are known to the cube root of rounding; their polynomial is not.
    np.testing.assert_allclose(coefficients, exact, rtol=1e-9)


@pytest.mark.parametrize("bandwidth", [10.0, 40.0])
def test_a_triple_pole_is_at_minus_the_bandwidth(actuator, bandwidth):
    stiffness, damping, integral = triple_pole(bandwidth)
    period_s = 1e-6
    matrix = closed_loop(
        PID(stiffness=stiffness, damping=damping, integral=integral), period_s, actuator.inertia
    )
    per_second = np.poly((np.linalg.eigvals(matrix) - 1) / period_s)
    # (s + w)³; sampling moves its coefficients by some wT = 4e-5 of themselves.
    np.testing.assert_allclose(per_second, [1, 3 * bandwidth, 3 * bandwidth**2, bandwidth**3], rtol=2e-4)


def test_the_default_is_a_triple_pole():
    gains = PID()
    bandwidth = gains.damping[0] / 3
    assert (gains.stiffness[0], gains.damping[0], gains.integral[0]) == triple_pole(bandwidth)
    assert all(len(set(each)) == 1 for each in (gains.stiffness, gains.damping, gains.integral))


def test_a_constant_load_leaves_no_error():
    run = simulate(
        scenarios.load("hold", {"controller.law": "pid", "disturbance.load": 1.0, "plant.payload_kg": 0.05})
    )
    assert run.status == "completed"
    last = run.telemetry.rows(len(run.telemetry) - 100, len(run.telemetry))
    # After 3 s the triple pole has left (40·3)² e^(-40·3) of the start, 1e-48; the rest is rounding.
    assert np.abs(last["error_rad"]).max() < 1e-14
    pd = simulate(scenarios.load("hold", {"controller.law": "pd", "disturbance.load": 1.0}))
    assert np.abs(pd.telemetry["error_rad"][-1]).max() > 0.1  # without an integral it sags


def test_the_current_limit_holds_the_integral(monkeypatch):
    """A step that asks for more than the coils get. Without tracking the integral winds up, and loses it."""
    weak = {"controller.law": "pid", "disturbance.load": 0.0}
    weak |= {"drive.current_limit_A": 2.0, "nominal.current_limit_A": 2.0}
    limited = simulate(scenarios.load("hold", weak))
    build = PID.build

    def without_tracking(self, known):
        law = build(self, known)
        law.parameters[9:12] = 0.0
        return law

    monkeypatch.setattr(PID, "build", without_tracking)
    assert simulate(scenarios.load("hold", weak)).status == "left_workspace"
    assert limited.status == "completed"
    assert limited.telemetry["allocation_scale"].min() < 0.2
    start = limited.telemetry["error_rad"][0]
    assert np.max(-np.sign(start) * limited.telemetry["error_rad"] / np.abs(start)) < 0.5
