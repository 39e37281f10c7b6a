"""How a curve is judged: by what is known beforehand of made-up data."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from spheretwin.models.design import curve_check
from spheretwin.models.design.pole_torque import Mesh
from spheretwin.models.torque_curve import TorqueCurve


def shaped(step_deg, scale=1.0, noise=0.0):
    """A smooth curve with a peak near 10 degrees, f_t's shape, from a formula."""
    phi = np.radians(np.arange(0, 180 + step_deg / 2, step_deg))
    torque = scale * 0.02 * np.sin(phi) * np.exp(12 * (np.cos(phi) - 1))
    torque[1:-1] += np.random.default_rng(0).normal(0, noise, len(phi) - 2)
    return TorqueCurve(phi, torque)


def test_left_out_samples_of_a_smooth_curve_are_found_again():
    fine, coarse = (curve_check.leave_one_out(shaped(step)) for step in (1.0, 4.0))
    # The error of a cubic falls with the fourth power of the gap: 256.
    assert 100 < coarse.rms / fine.rms < 400
    assert fine.worst < 1e-5
    assert coarse.worst_deg < 60


def test_noise_shows():
    curve = shaped(1.0, noise=1e-5)
    relative = 1e-5 / curve.peak_Nm_per_A
    # The point's own noise, and that of the neighbours it is compared with.
    assert_allclose(curve_check.leave_one_out(curve).rms, 1.4 * relative, rtol=0.2)


def test_a_single_bad_sample_is_pointed_at():
    curve = shaped(2.0)
    curve.torque_Nm_per_A[20] *= 1.1
    assert curve_check.leave_one_out(curve).worst_deg == pytest.approx(40.0)


def test_difference_knows_a_scaled_curve(actuator):
    curve = actuator.torque_curve
    rows = np.r_[0:120:4, 120:721:40]
    data = TorqueCurve(curve.phi_rad[rows], 0.9 * curve.torque_Nm_per_A[rows])
    result = curve_check.difference(data, actuator.magnet, actuator.coil, Mesh(12, 64, 6, 12))
    assert result.scale == pytest.approx(0.9, abs=1e-4)
    assert result.as_given.worst == pytest.approx(0.1, rel=0.02)
    assert result.as_given.worst_deg == pytest.approx(10.5, abs=1.0)
    assert result.scaled.worst < 1e-3
