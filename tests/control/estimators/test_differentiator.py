"""Levant's differentiator: exact without noise, no chatter, and the noise of its linear likeness."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_continuous_lyapunov
from scipy.special import gamma

from spheretwin.control.estimators import differentiator
from spheretwin.control.estimators.differentiator import BANDWIDTH, L1, L2, L3, VARIANCE, Differentiator
from spheretwin.control.estimators.estimator import estimates
from spheretwin.models.base.errors import InputError
from tests.control.estimators.cases import NOISE, PERIOD, built, on_all_axes, sampling

COEFFICIENTS, POWERS = np.array([2.0, 2.12, 1.1]), np.array([2 / 3, 1 / 3, 0.0])


def gain(frequency):
    s = 1j * frequency
    return np.abs((L2 * s + L3) / (s**3 + L1 * s**2 + L2 * s + L3))


class SlowDifferentiator:
    """The implicit step in the units of the angle, its cubic solved by the eigenvalues of a matrix."""

    def __init__(self, bandwidth, period, noise):
        self.T, self.L = period, noise * (bandwidth / 1.646549) ** 3
        self.z = None

    def __call__(self, angle):
        T, L = self.T, self.L
        self.z = np.array([angle, 0.0, 0.0]) if self.z is None else self.z
        z = np.array([[1, T, T**2 / 2], [0, 1, T], [0, 0, 1]]) @ self.z
        ahead = z[0] - angle
        sign, limited, cube = np.sign(ahead), min(abs(ahead), 1.1 * L * T**3), 0.0
        if abs(ahead) > limited:  # in the third root of the error
            roots = np.roots([1, 2 * L ** (1 / 3) * T, 2.12 * L ** (2 / 3) * T**2, limited - abs(ahead)])
            cube = roots[np.abs(roots.imag) <= 1e-9 * np.abs(roots)].real.max()
        push = 2.12 * L ** (2 / 3) * cube * T + 1.5 * limited / T
        self.z = np.array([angle + sign * cube**3, z[1] - sign * push, z[2] - sign * limited / T**2])
        return self.z[1]


@pytest.mark.parametrize("bandwidth", [15.0, 150.0, 1000.0])
def test_machine_code_is_the_slow_copy(bandwidth):
    generator = np.random.default_rng(2)
    angle = 0.2 * np.sin(0.01 * np.arange(600)) + generator.normal(scale=NOISE, size=600)
    angle[300:] += 0.15
    slow = SlowDifferentiator(bandwidth, PERIOD, NOISE)
    result = estimates(built("differentiator", bandwidth_rad_s=bandwidth), on_all_axes(angle))[:, 0]
    # The eigenvalues are rounded, magnified by the slope's 1/T.
    np.testing.assert_allclose(result, [slow(sample) for sample in angle], rtol=1e-8, atol=1e-9)


def test_linear_likeness_is_the_mean_slope_of_the_powers():
    # Price's theorem: the mean slope at a normal number is the mean product with it, E |n|^(p+1).
    slopes = COEFFICIENTS * 2 ** ((POWERS + 1) / 2) * gamma((POWERS + 2) / 2) / np.sqrt(np.pi)
    np.testing.assert_allclose([L1, L2, L3], slopes, rtol=1e-14)
    assert gain(BANDWIDTH) == pytest.approx(np.sqrt(0.5), rel=1e-5)  # as many digits as the constant has
    assert np.all(gain(np.linspace(BANDWIDTH * 1.001, 100, 10_000)) < np.sqrt(0.5))


def test_variance_solves_the_lyapunov_equation():
    moments = POWERS[:, None] + POWERS
    drive = (
        np.outer(COEFFICIENTS, COEFFICIENTS) * 2 ** (moments / 2) * gamma((moments + 1) / 2) / np.sqrt(np.pi)
    )
    A = np.array([[-L1, 1, 0], [-L2, 0, 1], [-L3, 0, 0]])
    assert solve_continuous_lyapunov(A, -drive)[1, 1] == pytest.approx(VARIANCE, rel=1e-6)


@pytest.mark.parametrize("bandwidth", [60.0, 150.0, 300.0])
def test_noise_gain_is_the_derived_one(bandwidth):
    angle = np.random.default_rng(0).normal(scale=NOISE, size=(200_000, 3))
    rate = estimates(built("differentiator", bandwidth_rad_s=bandwidth), angle)[5000:]
    derived = Differentiator(bandwidth_rad_s=bandwidth).derived(sampling()).noise_gain_1_s[0]
    # A few per cent while ωT is below 0.3, as the docstring says; the sampling itself leaves about 1 %.
    assert rate.std() / NOISE == pytest.approx(derived, rel=0.05)


def test_bandwidth_is_where_the_gain_of_a_small_motion_has_fallen_by_3_dB():
    bandwidth, period = 50.0, 1e-3
    tick = np.arange(400_000)
    phase = bandwidth * period * tick
    noise = np.random.default_rng(1).normal(scale=NOISE, size=(len(tick), 3))
    amplitude = 0.05 * NOISE  # beside the noise it is small
    rate = estimates(
        built("differentiator", bandwidth_rad_s=bandwidth), amplitude * np.sin(phase)[:, None] + noise
    )
    share = 2 * np.abs(np.exp(-1j * phase) @ rate).mean() / len(tick) / (amplitude * bandwidth)
    assert share == pytest.approx(np.sqrt(0.5), rel=0.1)


@pytest.mark.parametrize("jerk", [10.0, 2000.0])
def test_noise_free_sine_leaves_the_error_of_three_samples_alone(jerk):
    # Where the bound holds, the estimate is the slope of the parabola through the last three samples.
    time = PERIOD * np.arange(6000)
    angle = 0.2 * np.sin(np.pi * time)
    rate = estimates(built("differentiator", largest_jerk_rad_s3=jerk), on_all_axes(angle))[:, 0]
    parabola = (3 * angle[2:] - 4 * angle[1:-1] + angle[:-2]) / (2 * PERIOD)
    # Rounded angles over T, and no term of L T² (1e-5 and more): there is no chatter.
    np.testing.assert_allclose(rate[3000:], parabola[2998:], rtol=0, atol=1e-11)


@pytest.mark.parametrize("jump", [0.1, 6.0, 50.0])
@pytest.mark.parametrize("jerk", [50.0, 2000.0, 1e5])
def test_jump_of_the_rate_is_over_in_finite_time(jump, jerk):
    time = PERIOD * np.arange(6000)
    rate = estimates(built("differentiator", largest_jerk_rad_s3=jerk), on_all_axes(jump * time))[:, 0]
    wrong = np.flatnonzero(np.abs(rate - jump) > 1e-9 * jump)
    assert time[wrong[-1]] < 3.1 * math.sqrt(jump / jerk) + 3 * PERIOD


@given(st.floats(0, 1e160))
def test_root_solves_its_cubic(rest):
    u = differentiator.root(rest)
    assert u >= 0
    # Three roundings in the cubic, and denormals at its foot.
    assert ((u + 2) * u + 2.12) * u == pytest.approx(rest, rel=1e-15 * 8, abs=1e-322)


def test_unknown_noise_is_the_prototype_s():
    unknown = Differentiator().jerk(sampling(noise=0.0))
    np.testing.assert_array_equal(unknown, Differentiator().jerk(sampling(noise=math.radians(0.02))))
    np.testing.assert_allclose(unknown, 40_000, rtol=2e-3)  # as the docstring has it


def test_jerk_that_cannot_be_computed_with_is_refused():
    with pytest.raises(InputError, match="differentiator: expected a largest jerk in rad/s³ from 1e-30"):
        Differentiator(bandwidth_rad_s=1e-3, noise_rad=1e-25).build(sampling())
