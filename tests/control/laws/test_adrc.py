"""ADRC: its equations and the poles of its observer."""

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
