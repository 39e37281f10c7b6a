"""Trajectories: the paper's numbers, and rates that are the derivatives of the angles."""

import numpy as np
import pytest

from spheretwin.twin.trajectories.shapes import Hold, Nutation, Sinusoid, Tilt

STEP = 1e-5


@pytest.mark.parametrize("trajectory", [Sinusoid(), Nutation(), Hold(angle_rad=(0.1, 0.2, 0.3))])
def test_rates_and_accelerations_are_derivatives(trajectory):
    t = np.linspace(0.1, 4.9, 50)
    before, now, after = (trajectory.sample(t + h) for h in (-STEP, 0, STEP))
    # Central differences: h² times a third derivative below 200, and rounding of 31 rad over h.
    np.testing.assert_allclose(now[:, 1], (after - before)[:, 0] / (2 * STEP), atol=1e-7)
    np.testing.assert_allclose(now[:, 2], (after - before)[:, 1] / (2 * STEP), atol=1e-7)


def test_nutation_is_equation_59():
    t = np.array([0.0, 1.25, 5.0])
    expected = np.stack([0.2 * np.sin(np.pi * t), 0.2 * t * np.cos(np.pi * t), 2 * np.pi * t], axis=1)
    np.testing.assert_allclose(Nutation().sample(t)[:, 0], expected, atol=1e-15)
    assert abs(Nutation().sample(np.array([5.0]))[0, 0, 1]) == pytest.approx(1.0)  # beta ends at 1 rad


def test_tilt_is_equation_60():
    t = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0])
    expected = np.pi / 30 * np.array([0, 1, 2, 2, 2, 1, 0, 0])
    samples = Tilt().sample(t)
    np.testing.assert_allclose(samples[:, 0, 0], expected, atol=1e-15)
    np.testing.assert_allclose(samples[:, 1, 0], np.pi / 30 * np.array([1, 1, 0, 0, -1, -1, 0, 0]))
    np.testing.assert_array_equal(samples[:, :, 1:], 0)
