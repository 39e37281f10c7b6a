"""The linear estimators against the transfer functions, gains and lags that their docstrings derive."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from scipy.signal import freqz, lfilter

from spheretwin.control.estimators import ESTIMATORS
from spheretwin.control.estimators.estimator import estimates
from spheretwin.control.estimators.kalman import gains
from tests.control.estimators.cases import NOISE, PERIOD, built, on_all_axes, sampling

LINEAR = pytest.mark.parametrize("kind", ["difference", "kalman"])
BANDWIDTHS = pytest.mark.parametrize("bandwidth", [20.0, 150.0, 1000.0])


def transfer(kind, bandwidth, period=PERIOD):
    """Numerator and denominator in z⁻¹, from angle to rate."""
    if kind == "difference":
        pole = np.exp(-bandwidth * period)
        return (1 - pole) / period * np.array([1, -1]), np.array([1, -pole])
    (alpha,), (beta,) = gains(np.array([bandwidth * period]))
    return beta / period * np.array([1, -1, 0]), np.array([1, alpha + beta - 2, 1 - alpha])


@LINEAR
@BANDWIDTHS
def test_estimator_is_its_transfer_function(kind, bandwidth):
    angle = np.cumsum(np.random.default_rng(0).normal(scale=1e-3, size=1000))
    result = estimates(built(kind, bandwidth_rad_s=bandwidth), on_all_axes(angle))[:, 0]
    # It starts at rest at the first angle, as a filter does at zero.
    rest = angle - angle[0]
    expected = lfilter(*transfer(kind, bandwidth), rest)
    np.testing.assert_allclose(result, expected, rtol=1e-8, atol=1e-10)  # sums of 1000 rounded terms / T


@LINEAR
@BANDWIDTHS
def test_noise_gain_is_the_derived_one(kind, bandwidth):
    angle = np.random.default_rng(1).normal(scale=NOISE, size=(200_000, 3))
    unsettled = round(20 / (bandwidth * PERIOD))
    rate = estimates(built(kind, bandwidth_rad_s=bandwidth), angle)[unsettled:]
    measured = rate.var() / NOISE**2
    derived = ESTIMATORS[kind](bandwidth_rad_s=bandwidth).derived(sampling()).noise_gain_1_s[0] ** 2
    impulse = np.zeros(2 * unsettled)
    impulse[0] = 1.0
    response = lfilter(*transfer(kind, bandwidth), impulse)
    assert derived == pytest.approx(np.sum(response**2), rel=1e-9)  # the definition
    # Bartlett's variance of a variance that is estimated from correlated samples; four deviations.
    correlation = np.correlate(response, response, "full") / np.sum(response**2)
    deviation = np.sqrt(2 * np.sum(correlation**2) / rate.size)
    assert measured == pytest.approx(derived, rel=4 * deviation)


@LINEAR
def test_bandwidth_is_where_the_gain_has_fallen_by_3_dB(kind):
    bandwidth, period = 100.0, 1e-5
    frequency, response = freqz(*transfer(kind, bandwidth, period), worN=np.array([bandwidth * period]))
    gain = np.abs(response / (1j * frequency / period))
    assert gain == pytest.approx(np.sqrt(0.5), rel=2 * bandwidth * period)  # the limit of small ωT


@LINEAR
def test_limits_of_small_periods_are_those_of_the_docstring(kind):
    bandwidth, period = 100.0, 1e-6
    derived = ESTIMATORS[kind](bandwidth_rad_s=bandwidth).derived(sampling(period))
    noise_gain, lag_s = {
        "difference": (bandwidth, 1 / bandwidth),
        "kalman": (np.sqrt(bandwidth**3 * period / np.sqrt(8)), np.sqrt(2) / bandwidth),
    }[kind]
    np.testing.assert_allclose(derived.noise_gain_1_s, noise_gain, rtol=2 * bandwidth * period)
    np.testing.assert_allclose(derived.lag_s, lag_s, rtol=2 * bandwidth * period)


@pytest.mark.parametrize("share", [0.01, 0.1, 0.5, 2.0, 3.4641016151377544, 5.0, 30.0])
def test_gain_solves_the_riccati_equation(share):
    # In units of the period and the noise: q T³/σ² = (ωT)⁴. Both sides of ωT = √12, where the poles meet.
    A, C = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    Q = share**4 * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])
    P = solve_discrete_are(A.T, C.T, Q, np.eye(1))
    expected = P[:, 0] / (P[0, 0] + 1)
    # The solver loses the square of the condition, (1/ωT)² here.
    np.testing.assert_allclose(np.ravel(gains(np.array([share]))), expected, rtol=1e-10 / min(share, 1) ** 2)


@pytest.mark.parametrize("share", [1e-8, 1e-4, 1.0, 1e4, 1e7])
def test_filter_is_stable_at_any_bandwidth(share):
    (alpha,), (beta,) = gains(np.array([share]))
    assert 0 < alpha <= 1
    assert 0 < beta < 4 - 2 * alpha  # Jury's criterion


def test_density_and_noise_lead_to_a_bandwidth():
    bandwidth = 120.0
    density = bandwidth**4 * NOISE**2 * PERIOD
    by_bandwidth = built("kalman", bandwidth_rad_s=bandwidth).parameters
    by_sensors = built("kalman", acceleration_density_rad2_s3=density).parameters
    by_own = built("kalman", sampling(noise=0.0), acceleration_density_rad2_s3=density, noise_rad=NOISE)
    np.testing.assert_allclose(by_sensors, by_bandwidth, rtol=1e-12)
    np.testing.assert_allclose(by_own.parameters, by_bandwidth, rtol=1e-12)
