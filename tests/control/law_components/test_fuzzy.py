"""The fuzzy approximator against its definition, also where that underflows."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.control.law_components import fuzzy
from tests.control.laws.cases import regressor

anywhere = st.floats(-1e150, 1e150)
near = st.floats(-6, 6)


def firing_strengths(rate, angle):
    """Of the 25 rules, normalised (34): degrees that sum to 1 have products that do."""
    return np.outer(fuzzy.memberships(rate), fuzzy.memberships(angle)).ravel()


@given(anywhere, anywhere)
def test_basis_sums_to_one_anywhere(rate, angle):
    psi = firing_strengths(rate, angle)
    assert np.all(psi >= 0)
    assert psi.sum() == pytest.approx(1, abs=1e-14)  # 25 roundings


@given(near, near)
def test_basis_is_the_paper_s_where_that_can_be_computed(rate, angle):
    np.testing.assert_allclose(firing_strengths(rate, angle), regressor(rate, angle)[:25], rtol=1e-12)


def test_far_spin_angle_underflows_nothing():
    # The nutation ends at gamma = 31 rad, where every Gaussian of the definition is below 1e-40.
    psi = firing_strengths(6.28, 31.4)
    assert psi.sum() == pytest.approx(1, abs=1e-14)
    assert np.all(psi > 0)


@given(st.floats(90, 1e3))
def test_far_from_the_centres_one_set_has_all_of_the_degree(distance):
    # At 90 the next set has 5e-15 of it, by the definition.
    assert fuzzy.memberships(distance) == pytest.approx((0, 0, 0, 0, 1), abs=1e-14)
    assert fuzzy.memberships(-distance) == pytest.approx((1, 0, 0, 0, 0), abs=1e-14)


def test_an_input_that_is_no_number_has_no_degrees():
    assert np.isnan(fuzzy.memberships(np.nan)).all()


@given(near, near, st.floats(-1, 1), st.integers(0, 2**32 - 1))
def test_approximation_and_adaptation_are_the_regressor_form(rate, angle, drive, seed):
    theta = np.random.default_rng(seed).normal(size=75)
    basis = regressor(rate, angle)
    adapted = theta.copy()
    output = fuzzy.approximate_and_adapt(rate, angle, drive, adapted)
    assert output == pytest.approx(theta @ basis, rel=1e-12, abs=1e-12)
    np.testing.assert_allclose(adapted, theta + drive * basis, rtol=1e-12, atol=1e-14)


# The restrained approximator

PERIOD = 1e-3
FREE = fuzzy.AdaptationLimits(0.0, 0.0, 1e9)


def learn(s, limits, ticks=1, theta=None, adaptation=10.0):
    theta = np.zeros(75) if theta is None else theta.copy()
    outputs = [
        fuzzy.approximate_within_bounds(0.3, -0.2, s, adaptation, limits, PERIOD, theta) for _ in range(ticks)
    ]
    return theta, outputs


def test_unrestrained_it_is_the_plain_one():
    theta, outputs = learn(0.4, FREE, 50)
    plain = np.zeros(75)
    expected = [fuzzy.approximate_and_adapt(0.3, -0.2, -10.0 * 0.4 * PERIOD, plain) for _ in range(50)]
    np.testing.assert_array_equal(outputs, expected)
    np.testing.assert_array_equal(theta, plain)


def test_nothing_is_learnt_within_the_dead_zone():
    assert not learn(0.01, fuzzy.AdaptationLimits(0.01, 0.0, 1e9))[0].any()
    assert learn(0.011, fuzzy.AdaptationLimits(0.01, 0.0, 1e9))[0].any()


def test_what_was_learnt_leaks_away():
    theta, _ = learn(0.0, fuzzy.AdaptationLimits(0.01, 2.0, 1e9), 500, np.ones(75))
    np.testing.assert_allclose(theta, (1 - 2.0 * PERIOD) ** 500, rtol=1e-12)  # 500 roundings


def test_the_norm_stays_at_its_bound():
    theta, _ = learn(-5.0, fuzzy.AdaptationLimits(0.0, 0.0, 0.3), 200)
    assert np.linalg.norm(theta) == pytest.approx(0.3, rel=1e-12)
