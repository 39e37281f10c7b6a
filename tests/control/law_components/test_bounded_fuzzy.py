"""The restrained approximator: as the plain one where nothing restrains it, and what each restraint does."""

import numpy as np
import pytest

from spheretwin.control.law_components.fuzzy import (
    AdaptationLimits,
    approximate_and_adapt,
    approximate_within_bounds,
)

PERIOD = 1e-3
FREE = AdaptationLimits(0.0, 0.0, 1e9)


def learn(s, limits, ticks=1, theta=None, adaptation=10.0):
    theta = np.zeros(75) if theta is None else theta.copy()
    outputs = [
        approximate_within_bounds(0.3, -0.2, s, adaptation, limits, PERIOD, theta) for _ in range(ticks)
    ]
    return theta, outputs


def test_unrestrained_it_is_the_plain_one():
    theta, outputs = learn(0.4, FREE, 50)
    plain = np.zeros(75)
    expected = [approximate_and_adapt(0.3, -0.2, -10.0 * 0.4 * PERIOD, plain) for _ in range(50)]
    np.testing.assert_array_equal(outputs, expected)
    np.testing.assert_array_equal(theta, plain)


def test_nothing_is_learnt_within_the_dead_zone():
    assert not learn(0.01, AdaptationLimits(0.01, 0.0, 1e9))[0].any()
    assert learn(0.011, AdaptationLimits(0.01, 0.0, 1e9))[0].any()


def test_what_was_learnt_leaks_away():
    theta, _ = learn(0.0, AdaptationLimits(0.01, 2.0, 1e9), 500, np.ones(75))
    np.testing.assert_allclose(theta, (1 - 2.0 * PERIOD) ** 500, rtol=1e-12)  # 500 roundings


def test_the_norm_stays_at_its_bound():
    theta, _ = learn(-5.0, AdaptationLimits(0.0, 0.0, 0.3), 200)
    assert np.linalg.norm(theta) == pytest.approx(0.3, rel=1e-12)
