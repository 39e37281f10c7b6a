"""Every registered estimator: what all of them promise, and what each does with odd input."""

import math
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.control.estimators import ESTIMATORS
from spheretwin.control.estimators.estimator import LARGEST_ANGLE_rad, Sampling, estimates
from tests.control.estimators.cases import NOISE, PERIOD, built, on_all_axes, sampling

KINDS = [kind for kind, parameters in ESTIMATORS.items() if parameters().build(sampling()) is not None]
EACH = pytest.mark.parametrize("kind", KINDS)

anything = st.one_of(
    st.floats(),
    st.sampled_from([math.nan, math.inf, -math.inf, sys.float_info.max, -sys.float_info.max, 5e-324, -0.0]),
    st.floats(-10, 10),
)


def test_ideal_is_no_estimator_and_the_first():
    assert next(iter(ESTIMATORS)) == "ideal"
    assert KINDS == ["difference", "kalman", "differentiator"]


@EACH
@pytest.mark.parametrize("angle", [0.0, 0.7, -31.4, 1e-310, 1e90])
def test_constant_angle_has_no_rate_from_the_first_tick_on(kind, angle):
    rate = estimates(built(kind), np.full((200, 3), angle))
    np.testing.assert_array_equal(rate, 0.0)


@EACH
@pytest.mark.parametrize("angle", [0.0, 1e3])
def test_first_call_starts_at_the_first_angle(kind, angle):
    # From the second tick on, the start makes no difference but for the rounding of angles, magnified by
    # a gain of at most 1/T a tick.
    motion = on_all_axes(0.01 * np.sin(0.3 * np.arange(50)))
    rate = estimates(built(kind), angle + motion)
    np.testing.assert_array_equal(rate[0], 0.0)
    rounding = 4 * np.spacing(angle + 1.0) / PERIOD
    np.testing.assert_allclose(rate, estimates(built(kind), motion), rtol=1e-9, atol=rounding)


def settled_s(kind, rate):
    """When a jump of the rate is over: thirty time constants (e^-30 = 1e-13), or the finite time."""
    if kind == "differentiator":
        jerk = ESTIMATORS[kind]().jerk(sampling())[0]
        return 3.1 * math.sqrt(abs(rate) / jerk) + 3 * PERIOD
    slowest = ESTIMATORS[kind]().bandwidth_rad_s[0] / (math.sqrt(2) if kind == "kalman" else 1)
    return 30 / slowest


@EACH
@pytest.mark.parametrize("rate", [1e-3, 0.63, -6.28, 100.0])
def test_ramp_is_followed_exactly_after_the_stated_time(kind, rate):
    settled = math.ceil(settled_s(kind, rate) / PERIOD)
    time = PERIOD * np.arange(settled + 300)
    result = estimates(built(kind), on_all_axes(rate * time))[settled:]
    # Angles are rounded to half a unit in the last place, which the slope magnifies by 1/T a few times over.
    rounding = 4 * np.spacing(abs(rate) * time[-1]) / PERIOD
    np.testing.assert_allclose(result, rate, rtol=1e-11, atol=rounding)


@EACH
@pytest.mark.parametrize("acceleration", [2.0, -30.0])
def test_lag_behind_a_ramp_of_the_rate_is_the_derived_one(kind, acceleration):
    time = PERIOD * np.arange(1500)
    result = estimates(built(kind), on_all_axes(0.5 * acceleration * time**2))[-300:]
    lag = time[-300:, None] - result / acceleration
    rounding = 4 * np.spacing(0.5 * time[-1] ** 2) / PERIOD
    derived = ESTIMATORS[kind]().derived(sampling()).lag_s
    np.testing.assert_allclose(lag, np.broadcast_to(derived, lag.shape), rtol=1e-9, atol=rounding)


@EACH
def test_axes_are_independent(kind):
    generator = np.random.default_rng(0)
    angle = np.cumsum(generator.normal(scale=1e-3, size=(300, 3)), axis=0)
    bandwidths = (60.0, 150.0, 400.0)
    together = estimates(built(kind, bandwidth_rad_s=bandwidths), angle)
    for axis, bandwidth in enumerate(bandwidths):
        alone = estimates(built(kind, bandwidth_rad_s=bandwidth), on_all_axes(angle[:, axis]))
        np.testing.assert_array_equal(together[:, axis], alone[:, 0])


@EACH
def test_a_non_finite_angle_gives_nan_and_restarts_the_axis(kind):
    angle = 5.0 + on_all_axes(2.0 * PERIOD * np.arange(200))
    broken = angle.copy()
    broken[100, 1], broken[120, 2] = np.nan, np.inf
    whole, rate = estimates(built(kind), angle), estimates(built(kind), broken)
    np.testing.assert_array_equal(np.argwhere(~np.isfinite(rate)), [[100, 1], [120, 2]])
    np.testing.assert_array_equal(rate[:, 0], whole[:, 0])
    np.testing.assert_array_equal(rate[[101, 121], [1, 2]], 0.0)
    np.testing.assert_array_equal(rate[101:, 1], estimates(built(kind), angle[101:])[:, 1])


@EACH
@given(
    angle=st.lists(st.tuples(anything, anything, anything), min_size=1, max_size=30),
    bandwidth=st.floats(1e-3, 1e6),
    period=st.sampled_from([1e-5, 1e-3, 0.1]),
)
def test_rate_is_a_number_where_the_angle_is(kind, angle, bandwidth, period):
    estimator = built(kind, sampling(period), bandwidth_rad_s=bandwidth)
    given_angle = np.array(angle)
    rate = estimates(estimator, given_angle)
    np.testing.assert_array_equal(np.isfinite(rate), np.isfinite(given_angle))


@EACH
def test_huge_angles_are_taken_for_the_largest(kind):
    # Beyond it, all angles are the same: no motion between them, and none lost on the way back.
    angle = on_all_axes([1.1 * LARGEST_ANGLE_rad, 1e200, sys.float_info.max])
    np.testing.assert_array_equal(estimates(built(kind), angle), 0.0)


@EACH
def test_rounding_of_angles_counts_as_noise(kind):
    # A uniform error of one step has the variance of its square over twelve.
    quantum = math.sqrt(12) * NOISE
    by_noise, by_quantum = (
        ESTIMATORS[kind]().build(Sampling(PERIOD, np.full(3, noise), np.full(3, step))).parameters
        for noise, step in ((NOISE, 0.0), (0.0, quantum))
    )
    np.testing.assert_allclose(by_noise, by_quantum, rtol=1e-14)


@pytest.mark.parametrize("kind", ["kalman", "differentiator"])
@pytest.mark.parametrize("filters", [False, True])
def test_angles_are_replaced_only_where_that_is_asked_for(kind, filters):
    estimator = built(kind, bandwidth_rad_s=150.0, filters_angle=filters)
    state, rate = estimator.state.copy(), np.empty(3)
    raw = np.random.default_rng(3).normal(scale=NOISE, size=(3000, 3))
    handed = raw.copy()
    for angle in handed:
        estimator.step(angle, estimator.parameters, state, rate)
    if filters:
        assert np.all(handed[500:].std(axis=0) < 0.7 * raw[500:].std(axis=0))
    else:
        np.testing.assert_array_equal(handed, raw)
