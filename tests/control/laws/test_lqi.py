"""LQI: its gains solve the Riccati equation, which is checked without solving one."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_lyapunov

from spheretwin.control.laws.lqi import LQI, regulator
from spheretwin.control.laws.pid import PID
from tests.control.laws.cases import PERIOD, known

WEIGHTS = [(0.0, 0.0, 60.0**3), (3000.0, 30.0, 3e4), (0.0, 50.0, 10.0), (1e5, 0.0, 1e6)]


def sampled(period_s):
    """A double integrator and its integral, (e, ė, ∫e), over a period in which v is held."""
    T = period_s
    return np.array([[1, T, 0], [0, 1, 0], [T, 0, 1]]), np.array([[T * T / 2], [T], [0.0]])


@pytest.mark.parametrize("weights", WEIGHTS)
def test_gains_have_the_least_cost(weights):
    """The cost of these gains is P; the gains that are best where P is to come are these gains."""
    (A, B), K = sampled(PERIOD), np.array([regulator(*weights, PERIOD)])
    closed = A - B @ K
    assert np.abs(np.linalg.eigvals(closed)).max() < 1
    P = solve_discrete_lyapunov(closed.T, np.diag(np.square(weights)) + K.T @ K)
    best = np.linalg.solve(1 + B.T @ P @ B, B.T @ P @ A)
    # P is worth eps times the condition of 1 - closed, some 1e6 here, and so are the gains.
    np.testing.assert_allclose(K, best, rtol=1e-7)
    riccati = A.T @ P @ A - A.T @ P @ B @ best + np.diag(np.square(weights)) - P
    assert np.abs(riccati / np.sqrt(np.outer(np.diag(P), np.diag(P)))).max() < 1e-9


def test_law_is_the_feedback_with_these_gains(actuator):
    gains = LQI(
        error_weight=[100.0, 2000.0, 0.0], rate_weight=[0.0, 5.0, 9.0], integral_weight=[1e4, 2e4, 3e4]
    )
    each = [regulator(*weights, PERIOD) for weights in [(100, 0, 1e4), (2000, 5, 2e4), (0, 9, 3e4)]]
    stiffness, damping, integral = (list(gain) for gain in zip(*each, strict=True))
    pid = PID(stiffness=stiffness, damping=damping, integral=integral).build(known(actuator))
    lqi = gains.build(known(actuator))
    assert lqi.step is pid.step
    np.testing.assert_array_equal(lqi.parameters, pid.parameters)
