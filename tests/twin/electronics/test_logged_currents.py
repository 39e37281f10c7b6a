"""Mean currents of a log: against the solved differential equation, and charge that is conserved."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from spheretwin.electronics.logged_currents import mean_currents

SAMPLES_s = np.array([0.0, 1.0, 1.7, 3.0, 4.0]) * 1e-3
SAMPLES_A = np.array([[1.0, 0.0], [-2.0, 1.0], [3.0, 1.0], [0.5, -1.0], [2.0, 0.0]])


def given_current(t_s, delay_s, interpolated):
    """Current that is commanded at a time, (2,)."""
    at = t_s - delay_s
    if interpolated:
        return np.array([np.interp(at, SAMPLES_s, column) for column in SAMPLES_A.T])
    return SAMPLES_A[max(int(np.searchsorted(SAMPLES_s, at, side="right")) - 1, 0)]


def means(edges, delay_s=0.0, lag_s=0.0, interpolated=False, start=None):
    present = SAMPLES_A[0].copy() if start is None else start
    result = np.empty((len(edges) - 1, 2))
    lags_s = np.multiply(lag_s, [1.0, 1.5])  # of each group
    mean_currents(SAMPLES_s, SAMPLES_A, np.asarray(edges), delay_s, lags_s, interpolated, present, result)
    return result, present


EDGES = np.array([0.0, 0.4, 1.0, 2.3, 3.1, 6.0]) * 1e-3


@pytest.mark.parametrize(("lag_s", "interpolated"), [(0.0, False), (0.0, True), (8e-5, False), (7e-4, False)])
@pytest.mark.parametrize("delay_s", [0.0, 3e-4, 1e-3, -5e-4])
def test_they_are_those_of_the_lag_that_is_solved(delay_s, lag_s, interpolated):
    result, present = means(EDGES, delay_s, lag_s, interpolated)
    knots = np.unique(np.concatenate([EDGES, np.clip(SAMPLES_s + delay_s, EDGES[0], EDGES[-1])]))
    charge, current, sums = np.zeros(2), SAMPLES_A[0].copy(), [np.zeros(2)]
    for first, last in pairwise(knots):

        def slope(t, y, middle=(first + last) / 2):
            u = given_current(t if interpolated else middle, delay_s, interpolated)
            rate = (u - y[:2]) / np.multiply(lag_s, [1.0, 1.5]) if lag_s else 0 * u
            return np.concatenate([rate, y[:2]]) if lag_s else np.concatenate([0 * u, u])

        solved = solve_ivp(slope, (first, last), np.concatenate([current, charge]), rtol=1e-10, atol=1e-14)
        current, charge = solved.y[:2, -1], solved.y[2:, -1]
        sums.append(charge)
    at_edges = np.array(sums)[np.searchsorted(knots, EDGES)]
    # The reference is solved to 1e-10.
    assert np.allclose(result, np.diff(at_edges, axis=0) / np.diff(EDGES)[:, None], rtol=1e-7, atol=1e-7)
    if lag_s:
        assert np.allclose(present, current, rtol=1e-7)


@given(st.lists(st.floats(1e-5, 5.9e-3), min_size=1, max_size=6, unique=True), st.floats(-1e-3, 1e-3))
def test_charge_does_not_depend_on_where_intervals_end(inner, delay_s):
    edges = np.array([0.0, *sorted(inner), 6e-3])
    if np.min(np.diff(edges)) < 1e-9:
        return
    result, present = means(edges, delay_s, 2e-4)
    whole, at_once = means(np.array([0.0, 6e-3]), delay_s, 2e-4)
    charge = np.sum(result * np.diff(edges)[:, None], axis=0)
    assert np.allclose(charge, whole[0] * 6e-3, rtol=1e-12, atol=1e-15)
    assert np.allclose(present, at_once, rtol=1e-12, atol=1e-15)
