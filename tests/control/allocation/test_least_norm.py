"""Allocation: currents that give the torque, the smallest such, within the limit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.control.allocation.least_norm import allocate
from spheretwin.models.magnetics import torque_matrix

LIMIT = 8.0
tilts = st.floats(-1.0, 1.0)
poses = st.tuples(tilts, tilts, st.floats(-7, 7)).map(np.array)
torques = st.tuples(*[st.floats(-3, 3)] * 3).map(np.array)


def allocated(G, torque):
    current = np.full(18, np.nan)
    return allocate(G, torque, LIMIT, current), current


@given(q=poses, torque=torques)
def test_round_trip_keeps_direction_and_limit(actuator, q, torque):
    G = torque_matrix(q, actuator)
    scale, current = allocated(G, torque)
    assert 0 < scale <= 1
    assert np.abs(current).max() <= LIMIT
    # Cofactors lose the square of the condition number of G G^T, which stays below 100 here.
    np.testing.assert_allclose(G @ current, scale * torque, atol=1e-11)
    if scale < 1:
        assert np.abs(current).max() == pytest.approx(LIMIT, rel=1e-14)


@given(q=poses, torque=torques)
def test_currents_are_those_of_least_norm(actuator, q, torque):
    G = torque_matrix(q, actuator)
    scale, current = allocated(G, torque)
    np.testing.assert_allclose(current, scale * np.linalg.pinv(G) @ torque, atol=1e-9)


def test_lost_direction_gives_no_current():
    G = np.zeros((3, 18))
    G[:2] = np.random.default_rng(0).normal(size=(2, 18))
    scale, current = allocated(G, np.array([0.1, 0.2, 0.3]))
    assert scale == 0
    np.testing.assert_array_equal(current, np.zeros(18))


def test_no_torque_needs_no_current(actuator):
    scale, current = allocated(torque_matrix(np.zeros(3), actuator), np.zeros(3))
    assert scale == 1
    np.testing.assert_array_equal(current, np.zeros(18))
