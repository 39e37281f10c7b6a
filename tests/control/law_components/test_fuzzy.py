"""The fuzzy approximator against its definition, also where that underflows."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.control.law_components import fuzzy

anywhere = st.floats(-1e150, 1e150)
near = st.floats(-6, 6)


def firing_strengths(rate, angle):
    """Of the 25 rules, normalised (34): degrees that sum to 1 have products that do."""
    return np.outer(fuzzy.memberships(rate), fuzzy.memberships(angle)).ravel()


def papers_basis(rate, angle):
    """Products of Gaussians over their sum (34), (57): the definition."""
    of_rate = [np.exp(-0.5 * ((rate - c) / 2) ** 2) for c in (-3, -1.5, 0, 1.5, 3)]
    of_angle = [np.exp(-0.5 * ((angle - c) / 2) ** 2) for c in (-3, -1.5, 0, 1.5, 3)]
    products = np.array([a * b for a in of_rate for b in of_angle])
    return products / products.sum()


@given(anywhere, anywhere)
def test_basis_sums_to_one_anywhere(rate, angle):
    psi = firing_strengths(rate, angle)
    assert np.all(psi >= 0)
    assert psi.sum() == pytest.approx(1, abs=1e-14)  # 25 roundings


@given(near, near)
def test_basis_is_the_paper_s_where_that_can_be_computed(rate, angle):
    np.testing.assert_allclose(firing_strengths(rate, angle), papers_basis(rate, angle), rtol=1e-12)


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
    psi = firing_strengths(rate, angle)
    regressor = np.concatenate([psi, psi * rate, psi * angle])
    adapted = theta.copy()
    output = fuzzy.approximate_and_adapt(rate, angle, drive, adapted)
    assert output == pytest.approx(theta @ regressor, rel=1e-12, abs=1e-12)
    np.testing.assert_allclose(adapted, theta + drive * regressor, rtol=1e-12, atol=1e-14)
