"""The comparison measures what the docstrings derive."""

import numpy as np
import pytest

from spheretwin.control.estimators.noise_and_lag import compare

BANDWIDTHS = [60.0, 150.0, 400.0]


@pytest.fixture(scope="module")
def compared():
    return compare(BANDWIDTHS)


@pytest.mark.parametrize("kind", ["difference", "kalman"])
def test_linear_estimators_are_as_derived(compared, kind):
    result = compared[kind]
    # 48,000 samples on three axes, correlated over tens of ticks: 1 % and less.
    np.testing.assert_allclose(result.rms_error_rad_s, result.derived_rms_error_rad_s, rtol=0.02)
    # The lag of a sine, at π/ω of the bandwidth, differs from the limit by its square; noise by its spread.
    high_order = (np.pi / np.array(BANDWIDTHS)) ** 2 * result.derived_lag_s
    assert np.all(np.abs(result.lag_s - result.derived_lag_s) < 4 * result.lag_deviation_s + high_order)


def test_noise_and_lag_order_the_estimators(compared):
    assert list(compared) == ["difference", "kalman", "differentiator"]
    rms = {kind: result.rms_error_rad_s for kind, result in compared.items()}
    assert np.all(rms["kalman"][1:] < rms["difference"][1:])
    assert np.all(compared["difference"].lag_s < compared["kalman"].lag_s)
    assert np.all(compared["differentiator"].lag_s < 0.25 * compared["difference"].lag_s)


def test_differentiator_loses_a_motion_of_more_jerk_than_its_bound():
    # At 15 1/s its bound is 0.26 rad/s³; the sine has 6.2.
    result = compare([15.0])["differentiator"]
    assert result.rms_error_rad_s[0] > 0.5  # the rate itself has 0.44
