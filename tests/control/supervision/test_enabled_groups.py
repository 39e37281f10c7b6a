"""Disabled groups: no current in them, and the whole torque from the others."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.control.allocation import ALLOCATIONS
from spheretwin.control.allocation.bounded import SCRATCH_ROWS
from spheretwin.control.supervision.enabled_groups import (
    DETECTED_OPEN,
    DETECTED_SHORTED,
    IN_USE,
    REPORTED,
    EnabledGroups,
    mark_faulty_groups,
    mask_disabled_groups,
)
from spheretwin.models.magnetics import torque_matrix

COUNT, LIMIT_A = 18, 8.0


def at(*places):
    return np.isin(np.arange(COUNT), places)


def without(places, G):
    rows = EnabledGroups.zeros(groups=COUNT)
    mark_faulty_groups(rows, at(*places), 0.5)
    mask_disabled_groups(rows[0], G)
    return rows[0]


def allocated(name, G, torque):
    current = np.full(COUNT, 7.0)
    share = ALLOCATIONS[name](G, torque, LIMIT_A, current, np.empty((SCRATCH_ROWS, COUNT)))
    return current, share


@pytest.mark.parametrize("name", list(ALLOCATIONS))
@given(
    st.sets(st.integers(0, COUNT - 1), max_size=9),
    st.tuples(*[st.floats(-1.2, 1.2)] * 3),
    st.tuples(*[st.floats(-1, 1)] * 3),
)
def test_the_others_give_the_whole_torque(actuator, name, out, pose, torque):
    """Of the columns of the others, G I is the share of what is wanted, and I the smallest that gives it."""
    G, wanted = torque_matrix(np.array(pose), actuator), 0.2 * np.array(torque)
    current, share = allocated(name, without(out, G).G, wanted)
    used = ~at(*out)
    assert not current[~used].any()
    if share == 0.0:  # what is left has lost a direction
        sizes = np.linalg.svd(G[:, used], compute_uv=False)
        assert sizes[2] < 1e-5 * sizes[0]
        return
    # Rounding of eighteen products, each a millionth of the strongest direction at worst: the condition of
    # G G^T. Where the matrix is well off, 1e-12.
    condition = np.linalg.cond(G[:, used]) ** 2
    bound = 1e-14 * condition * (np.abs(G) @ np.abs(current)).max() + 1e-300
    np.testing.assert_allclose(G @ current, share * wanted, rtol=0, atol=bound)
    if share == 1.0 and np.abs(np.linalg.pinv(G[:, used]) @ wanted).max() <= LIMIT_A * (1 - 1e-9):
        expected = np.linalg.pinv(G[:, used]) @ wanted
        bound = 1e-14 * condition * np.abs(expected).max() + 1e-300
        np.testing.assert_allclose(current[used], expected, rtol=0, atol=bound)


@pytest.mark.parametrize("name", list(ALLOCATIONS))
def test_with_too_few_left_there_is_no_torque_and_no_current(actuator, name):
    G = torque_matrix(np.array([0.2, -0.1, 0.3]), actuator)
    for left in (0, 1, 2):
        current, share = allocated(name, without(range(left, COUNT), G).G, np.array([0.1, 0.2, 0.3]))
        assert share == 0.0
        assert not current.any()


def test_reported_groups_are_enabled_again_and_detected_ones_are_not():
    rows = EnabledGroups.zeros(groups=COUNT)
    made = rows[0]
    made.out[5], made.out[6] = DETECTED_OPEN, DETECTED_SHORTED
    mark_faulty_groups(rows, at(2, 5), 1.0)
    assert made.out[[2, 5, 6]].tolist() == [REPORTED, DETECTED_OPEN, DETECTED_SHORTED]
    assert made.out_s[2] == 1.0
    mark_faulty_groups(rows, at(2, 5), 2.0)
    assert made.out_s[2] == 1.0  # since when, not until when
    mark_faulty_groups(rows, at(), 3.0)
    assert made.out[[2, 5, 6]].tolist() == [IN_USE, DETECTED_OPEN, DETECTED_SHORTED]


def test_with_all_in_use_no_bit_of_the_matrix_is_another(actuator):
    G = torque_matrix(np.array([0.5, 0.3, -0.2]), actuator)
    made = without((), G)
    assert made.G.tobytes() == np.ascontiguousarray(G).tobytes()
    assert not made.out.any()


def test_faulty_groups_are_marked_in_each_row():
    rows = EnabledGroups.zeros(2, groups=3)
    mark_faulty_groups(rows, np.array([[False, True, False], [True, False, False]]), np.float64(0.5))
    np.testing.assert_array_equal(rows["out"], [[0, REPORTED, 0], [REPORTED, 0, 0]])
    np.testing.assert_array_equal(rows["out_s"], [[0.0, 0.5, 0.0], [0.5, 0.0, 0.0]])
