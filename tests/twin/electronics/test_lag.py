"""The current lag against the exact solution of its equation."""

import numpy as np
import pytest
from scipy.integrate import quad

from spheretwin.electronics.coil import advance_lag, current_lag


@pytest.mark.parametrize("time_constant_s", [1e-4, 6.9e-4, 5e-2])
def test_one_step_is_the_exact_exponential_and_its_mean(time_constant_s):
    step_s = 5e-4
    command, current, mean = np.array([3.0, -1.0]), np.array([0.5, 2.0]), np.empty(2)
    start = current.copy()
    advance_lag(current_lag(time_constant_s, step_s, 8.0), command, current, mean)

    def exact(t):
        return command + (start - command) * np.exp(-t / time_constant_s)

    np.testing.assert_allclose(current, exact(step_s), rtol=1e-14)
    expected = [quad(lambda t, j=j: exact(t)[j], 0, step_s, epsabs=1e-14)[0] / step_s for j in range(2)]
    np.testing.assert_allclose(mean, expected, rtol=1e-12)


def test_without_lag_the_current_is_the_command():
    command, current, mean = np.array([4.0]), np.zeros(1), np.empty(1)
    advance_lag(current_lag(0.0, 5e-4, 8.0), command, current, mean)
    assert current[0] == mean[0] == 4.0
