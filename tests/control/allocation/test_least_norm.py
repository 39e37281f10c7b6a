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


@given(q=poses, torque=torques)
def test_currents_are_those_of_least_norm_within_the_limit(actuator, q, torque):
    G, current = torque_matrix(q, actuator), np.full(18, np.nan)
    scale = allocate(G, torque, LIMIT, current)
    assert 0 < scale <= 1
    assert np.abs(current).max() <= LIMIT
    np.testing.assert_allclose(current, scale * np.linalg.pinv(G) @ torque, atol=1e-9)
    # Cofactors lose the square of the condition number of G G^T, which stays below 100 here.
    np.testing.assert_allclose(G @ current, scale * torque, atol=1e-11)
    if scale < 1:
        assert np.abs(current).max() == pytest.approx(LIMIT, rel=1e-14)
