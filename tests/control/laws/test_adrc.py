"""ADRC: its equations, the poles of its observer and what the observer finds."""

import numpy as np
import pytest

from spheretwin.control.laws.adrc import ADRC, observer_gains
from tests.control.laws.cases import PERIOD, follows, known


class Slow:
    """The law as its docstring has it: predict, correct, answer, with the exact matrices of a period."""

    def __init__(self, gains, inertia):
        self.gains, self.J, self.x = gains, inertia, None

    def __call__(self, reference, measurement):
        w, a = np.array(self.gains.bandwidth), np.exp(-np.array(self.gains.observer_bandwidth) * PERIOD)
        if self.x is None:
            self.x = np.array([measurement[0], measurement[1], np.zeros(3)])
        else:
            A = np.array([[1, PERIOD, PERIOD**2 / 2], [0, 1, PERIOD], [0, 0, 1]])
            self.x = A @ self.x + np.outer([PERIOD**2 / 2, PERIOD, 0], measurement[2] / self.J)
        l1, l3 = 1 - a**3, (1 - a) ** 3 / PERIOD**2
        l2 = (3 - 3 * a - l1 - 0.5 * l3 * PERIOD**2) / PERIOD
        self.x = self.x + np.array([l1, l2, l3]) * (measurement[0] - self.x[0])
        angle, rate, d = self.x
        wanted = reference[2] - w**2 * (angle - reference[0]) - 2 * w * (rate - reference[1])
        return self.J * (wanted - d), self.J * d


def test_law_follows_its_equations(actuator):
    gains = ADRC(bandwidth=[40.0, 80.0, 20.0], observer_bandwidth=[100.0, 300.0, 50.0])
    follows(gains.build(known(actuator)), Slow(gains, actuator.inertia))


@pytest.mark.parametrize("period_s", [1e-4, 1e-3, 1e-2])
@pytest.mark.parametrize("bandwidth", [30.0, 400.0])
def test_observer_has_the_documented_poles(bandwidth, period_s):
    T, gains = period_s, np.array([gain[0] for gain in observer_gains(np.array([bandwidth]), period_s)])
    A = np.array([[1, T, T * T / 2], [0, 1, T], [0, 0, 1]])
    error = A - np.outer(gains, A[0])  # predicted, then corrected by what the angle misses by
    a = np.exp(-bandwidth * period_s)
    # Three poles at once are known to the cube root of rounding; the coefficients of 1 − z to rounding, up to
    # the size of the entries, 1/T² of them at most.
    coefficients = np.poly(np.linalg.eigvals(error - np.eye(3)))
    np.testing.assert_allclose(coefficients, np.poly([a - 1] * 3), rtol=1e-6, atol=1e-13)


def observed(actuator, gains, load_Nm, ticks):
    """Errors of the observer's angle, rate and acceleration of β, which a known torque and a load push."""
    law, J = gains.build(known(actuator)), actuator.inertia[1]
    state, torque = law.state.copy(), np.zeros(3)
    angle, rate, missed = 0.1, 0.5, []
    for tick in range(ticks):
        measurement = np.zeros((3, 3))
        measurement[:, 1] = angle, rate, torque[1]
        law.step(0.0, np.zeros((3, 3)), measurement, law.parameters, state, torque)
        missed.append([state[4] - angle, state[7] - rate, (state[1] + load_Nm) / J])
        torque[1] = 0.01 * np.sin(0.1 * tick)  # whatever the coils give, as long as it is known
        push = (torque[1] - load_Nm) / J
        angle, rate = angle + PERIOD * rate + 0.5 * PERIOD**2 * push, rate + PERIOD * push
    return np.array(missed)


def test_the_observer_converges_at_the_rate_of_its_poles(actuator):
    """From an unknown load its error is that of the matrix whose poles were checked, tick by tick, to 0."""
    load_Nm, ticks = 0.05, 400
    gains = ADRC(observer_bandwidth=100.0)
    missed = observed(actuator, gains, load_Nm, ticks)
    A = np.array([[1, PERIOD, PERIOD**2 / 2], [0, 1, PERIOD], [0, 0, 1]])
    L = np.array([gain[0] for gain in observer_gains(np.array([100.0]), PERIOD)])
    left = np.array([0.0, 0.0, load_Nm / actuator.inertia[1]])
    for row in missed:
        # 400 steps of numbers whose rounding is some 1e-13 of the acceleration's 23 rad/s².
        np.testing.assert_allclose(row, left, atol=1e-9)
        left = (A - np.outer(L, A[0])) @ left
    assert np.abs(missed[-1]).max() < 1e-9  # e^(−40) 40² of 23 is 2e-13
