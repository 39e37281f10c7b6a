"""Bounded allocation: all the torque that the limit allows, from the smallest currents that give it."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.control.allocation.bounded import SCRATCH_ROWS, STEPS_PER_GROUP, follow_path
from spheretwin.control.allocation.simplex import increase_share
from spheretwin.models.magnetics import torque_matrix
from tests.control.allocation import cases

LIMIT = cases.LIMIT
tilts = st.floats(-cases.TILT, cases.TILT)
poses = st.tuples(tilts, tilts, st.floats(-7, 7)).map(np.array)
directions = st.tuples(*[st.floats(-1, 1)] * 3).map(np.array).filter(lambda u: np.linalg.norm(u) > 0.1)
multiples = st.floats(0.1, 5.0)  # of the torque at which the least-norm currents meet the limit


def within(rng, largest):
    """A multiple that least-norm currents give."""
    return rng.uniform(0.1, 1.0)


def between(rng, largest):
    """One that only bounded currents give, up to the largest."""
    return rng.uniform(1.0, largest)


def beyond(rng, largest):
    """One that no currents give."""
    return largest * (1.0 + 10 ** rng.uniform(-6, 0.5))


@pytest.mark.parametrize("regime", [within, between, beyond])
def test_scale_is_that_of_the_linear_programme(actuator, regime):
    """140 programmes a regime, over all kinds of matrix and direction; `make benchmark` tries 10,080."""
    rng = np.random.default_rng(1)
    kinds = list(product(cases.MATRICES, cases.DIRECTIONS))
    for case in range(140):
        matrix, direction = kinds[case % len(kinds)]
        G = cases.of_full_rank(rng, matrix, actuator)
        limit = 10 ** rng.uniform(-6, 3)
        unit = cases.at_multiple(G, direction(rng, G), 1.0, limit)
        reachable = limit * cases.largest_by_facets(G, unit)
        torque = unit * regime(rng, reachable)
        scale, current = cases.bounded(G, torque, limit)
        largest = cases.largest_by_programme(G, torque, limit)
        # Two computations of the same: HiGHS is asked for 1e-10.
        assert largest == pytest.approx(limit * cases.largest_by_facets(G, torque), rel=1e-9)
        assert scale == pytest.approx(min(largest, 1.0), rel=1e-9)
        assert (scale < 1) == (regime is beyond)
        plain_scale, plain = cases.least_norm(G, torque, limit)
        assert (plain_scale == 1) == (regime is within)
        if regime is within:
            np.testing.assert_array_equal(current, plain)
        assert np.abs(current).max() <= limit
        assert np.linalg.norm(G @ current - scale * torque) <= 1e-9 * np.linalg.norm(torque)


@given(q=poses, direction=directions, multiple=multiples)
def test_currents_within_reach_are_the_smallest(actuator, q, direction, multiple):
    """With some y, ``I = clip(G^T y)``: sufficient for the least norm, the problem being convex."""
    G = torque_matrix(q, actuator)
    scale, current = cases.bounded(G, cases.at_multiple(G, direction, multiple))
    free = np.abs(current) < LIMIT * (1 - 1e-9)
    if scale < 1 or np.linalg.matrix_rank(G[:, free]) < 3:
        return
    y = np.linalg.lstsq(G[:, free].T, current[free])[0]
    np.testing.assert_allclose(np.clip(G.T @ y, -LIMIT, LIMIT), current, atol=1e-6)


def test_currents_are_continuous_where_the_torque_passes_out_of_reach(actuator):
    rng = np.random.default_rng(3)
    for _ in range(50):
        G = cases.pose_matrix(rng, actuator)
        torque = cases.at_multiple(G, rng.normal(size=3), 10.0)
        scale, out_of_reach = cases.bounded(G, torque)
        assert scale < 1
        within, smallest = cases.bounded(G, torque * scale * (1 - 1e-9))
        assert within == 1
        # The steepest group seen goes from limit to limit within 1e-6 of the torque.
        np.testing.assert_allclose(out_of_reach, smallest, atol=0.05)
        assert cases.bounded(G, torque * scale * (1 + 1e-9))[1] == pytest.approx(out_of_reach, abs=1e-6)


def test_currents_jump_with_the_pose_out_of_reach_and_not_three_hundredths_within(actuator):
    q, turn = np.array([0.3, -0.2, 0.1]), np.array([0.1, 0.2, 0.5])
    torque = np.array([0.9, -1.8, 1.2])
    edge, within = [], []
    for part in np.linspace(0, 1, 2001):
        G = torque_matrix(q + turn * part, actuator)
        scale, current = cases.bounded(G, torque)
        assert scale < 1
        edge.append(current)
        within.append(cases.bounded(G, 0.97 * scale * torque)[1])
        assert np.linalg.norm(within[-1]) < np.linalg.norm(current)
    jumps = [np.abs(np.diff(currents, axis=0)).max() for currents in (edge, within)]
    assert jumps[1] < 1.0 < 8.0 < jumps[0]


def assert_gives(G, current, share, torque):
    """Compare what currents give with a share of a torque, to 1e-9 of the share."""
    expected = np.multiply(share, torque)
    np.testing.assert_allclose(G @ current, expected, rtol=0, atol=1e-9 * share * np.linalg.norm(torque))


def beyond_reach(rng, matrix, actuator):
    """Matrix, what least-norm currents give of a torque, in limits, and the largest multiple of that."""
    G = cases.of_full_rank(rng, matrix, actuator)
    direction = rng.normal(size=3) if rng.random() < 0.5 else cases.along_an_axis(rng, G)
    start = cases.at_multiple(G, direction, 1.0, 1.0)
    return G, tuple(start), cases.largest_by_facets(G, start)


@pytest.mark.parametrize(
    "matrix", [cases.pose_matrix, cases.dead_groups, cases.symmetric_pose, cases.small_integers]
)
def test_path_ends_well_within_its_steps_and_may_be_left_at_any(actuator, matrix):
    rng = np.random.default_rng(5)
    for _ in range(40):
        G, start, largest = beyond_reach(rng, matrix, actuator)
        groups = G.shape[1]
        scratch = np.empty((SCRATCH_ROWS, groups))
        result, _, needed = follow_path(G, start, 1e9, STEPS_PER_GROUP * groups, scratch)
        assert result == pytest.approx(largest, rel=1e-9)
        assert needed <= 1.5 * groups
        before = 0.0
        for steps in range(1, needed + 1):
            share, _, taken = follow_path(G, start, 1e9, steps, scratch)
            assert taken == steps
            assert share >= before * (1 - 1e-9)
            assert np.abs(scratch[0]).max() <= 1
            assert_gives(G, scratch[0], share, start)
            before = share


@pytest.mark.parametrize("matrix", cases.MATRICES)
def test_the_simplex_fallback_reaches_the_largest_torque(actuator, matrix):
    rng = np.random.default_rng(6)
    for _ in range(40):
        G, start, largest = beyond_reach(rng, matrix, actuator)
        demand = np.zeros(G.shape[1])
        share, steps = increase_share(G, start, 1e9, 0.0, 1000, demand)
        assert share == pytest.approx(largest, rel=1e-9)
        assert steps <= STEPS_PER_GROUP * G.shape[1]
        assert np.abs(demand).max() <= 1 + 1e-9
        assert_gives(G, demand, share, start)
        demand[:] = 0.0
        assert increase_share(G, start, 0.7 * largest, 0.0, 1000, demand)[0] == 0.7 * largest
        assert_gives(G, demand, 0.7 * largest, start)


powers = st.floats(-320, 307).map(lambda power: 10.0**power)
odd_numbers = st.sampled_from([np.nan, np.inf, -np.inf, 0.0, 1e308, -1e308, 5e-324])


@given(
    seed=st.integers(0, 2**32 - 1),
    size=powers,
    wanted=powers,
    limit=powers | st.sampled_from([0.0, -1.0, np.nan, np.inf]),
    odd=st.none() | odd_numbers,
    place=st.integers(0, 56),
)
def test_numbers_of_any_size_give_finite_currents_within_the_limit(seed, size, wanted, limit, odd, place):
    rng = np.random.default_rng(seed)
    numbers = np.append(
        np.clip(rng.normal(size=54), -3, 3) * size, np.clip(rng.normal(size=3), -3, 3) * wanted
    )
    if odd is not None:
        numbers[place] = odd
    scale, current = cases.bounded(numbers[:54].reshape(3, 18), numbers[54:], limit)
    assert 0 <= scale <= 1
    assert np.isfinite(current).all()
    assert scale == 0 or np.abs(current).max() <= limit
    if scale == 0:
        assert not current.any()
