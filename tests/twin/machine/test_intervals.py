"""Intervals: of a quadratic cost from its curvature, of another by its profile."""

import numpy as np
import pytest
from scipy.optimize import brentq

from spheretwin.machine.intervals import Z95, LeastSquaresCost, interval

FREE = np.full(2, -np.inf)


def quadratic():
    information = np.array([[4.0, 1.0], [1.0, 2.0]])
    best = np.array([0.3, -0.2])
    return LeastSquaresCost(
        lambda x: 0.5 * (x - best) @ information @ (x - best),
        lambda x: (information, information @ (x - best)),
        best,
        0.0,
        FREE,
        -FREE,
    ), np.linalg.inv(information)


def test_a_quadratic_cost_has_the_interval_of_its_curvature():
    cost, covariance = quadratic()
    for place in range(2):
        half = Z95 * np.sqrt(covariance[place, place])
        expected = cost.best[place] - half, cost.best[place] + half
        assert interval(cost, covariance, place) == pytest.approx(expected)
        low, high = interval(cost, covariance, place, wider=3.0)
        assert (low + 2 * half, high - 2 * half) == pytest.approx(expected)


def test_a_bound_ends_an_interval():
    cost, covariance = quadratic()
    bounded = cost._replace(least=np.array([0.25, -np.inf]), most=np.array([0.31, np.inf]))
    assert interval(bounded, covariance, 0) == (0.25, 0.31)


def test_another_cost_has_the_interval_of_its_profile():
    """Residuals 3 (exp x - 1) and y + x: the profile over y is half of 9 (exp x - 1)²."""

    def residuals(v):
        return np.array([3 * np.expm1(v[0]), v[1] + v[0]])

    def normal(v):
        slopes = np.array([[3 * np.exp(v[0]), 0.0], [1.0, 1.0]])
        return slopes.T @ slopes, slopes.T @ residuals(v)

    cost = LeastSquaresCost(
        lambda v: 0.5 * residuals(v) @ residuals(v), normal, np.zeros(2), 0.0, FREE, -FREE
    )
    low, high = interval(cost, np.linalg.inv(normal(np.zeros(2))[0]), 0)
    ends = [brentq(lambda x: 3 * abs(np.expm1(x)) - Z95, *sorted([0.0, far])) for far in (-2.0, 2.0)]
    # The search stops within 2 % of a deviation.
    assert (low, high) == pytest.approx(ends, abs=0.02 / 3 * 1.1)
    assert abs(low) > 1.5 * high
