"""Bounded allocation: all the torque that the limit allows, from the smallest currents that give it."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog, minimize

from spheretwin.control.allocation.bounded import (
    SCRATCH_ROWS,
    STEPS_PER_GROUP,
    allocate_bounded,
    follow_path,
)
from spheretwin.control.allocation.least_norm import allocate
from spheretwin.control.allocation.simplex import climb
from spheretwin.models.kinematics import rotation
from spheretwin.models.magnetics import torque_matrix

LIMIT = 8.0
TILT = np.deg2rad(80)
tilts = st.floats(-TILT, TILT)
poses = st.tuples(tilts, tilts, st.floats(-7, 7)).map(np.array)
directions = st.tuples(*[st.floats(-1, 1)] * 3).map(np.array).filter(lambda u: np.linalg.norm(u) > 0.1)
multiples = st.floats(0.1, 5.0)  # of the torque at which the least-norm currents meet the limit


def bounded(G, torque, limit=LIMIT):
    G = np.ascontiguousarray(G)  # any other layout is compiled for anew
    groups = G.shape[1]
    current = np.full(groups, np.nan)
    scale = allocate_bounded(G, torque, limit, current, np.full((SCRATCH_ROWS, groups), np.nan))
    return scale, current


def least_norm(G, torque, limit=LIMIT):
    G = np.ascontiguousarray(G)
    current = np.full(G.shape[1], np.nan)
    return allocate(G, torque, limit, current), current


def at_multiple(G, direction, multiple, limit=LIMIT):
    """Torque along a direction, as a multiple of what the least-norm currents can give."""
    return direction * (multiple * limit / np.abs(np.linalg.pinv(G) @ direction).max())


def largest_by_programme(G, torque, limit):
    """Largest s with ``G I = s torque`` and ``|I| <= limit``: by HiGHS, in units near 1."""
    size, wanted = np.abs(G).max(), np.abs(torque).max()
    groups = G.shape[1]
    result = linprog(
        np.append(np.zeros(groups), -1.0),
        A_eq=np.column_stack([G / size, -torque / wanted]),
        b_eq=np.zeros(3),
        bounds=[(-1, 1)] * groups + [(0, None)],
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    assert result.status == 0
    return -result.fun * size * limit / wanted


def largest_by_facets(G, torque):
    """Largest share again, at limit 1: each facet of the set of all torques is spanned by two columns."""
    pairs = np.array(list(combinations(range(G.shape[1]), 2)))
    normals = np.cross(G[:, pairs[:, 0]].T, G[:, pairs[:, 1]].T)
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals[lengths > 1e-13 * lengths.max()]
    reach, along = np.abs(normals @ G).sum(1), np.abs(normals @ torque)
    return (reach[along > 0] / along[along > 0]).min()


def pose_matrix(rng, actuator):
    return torque_matrix(rng.uniform([-TILT, -TILT, -np.pi], [TILT, TILT, np.pi]), actuator)


def dead_groups(rng, actuator):
    G = pose_matrix(rng, actuator)
    G[:, rng.choice(18, rng.integers(1, 12), replace=False)] = 0
    return G


def repeated_columns(rng, actuator):
    return pose_matrix(rng, actuator)[:, rng.integers(0, 18, 18)]


def nearly_repeated_columns(rng, actuator):
    G = pose_matrix(rng, actuator)[:, :9]
    return np.hstack([G, G + 10 ** rng.uniform(-16, -5) * rng.normal(size=(3, 9))])


def symmetric_pose(rng, actuator):
    return torque_matrix(np.deg2rad(rng.choice([0, 15, 30, 45, 60], 3)), actuator)


def nearly_symmetric_pose(rng, actuator):
    q = np.deg2rad(rng.choice([0, 0, 15, 30, 45, 60], 3))
    return torque_matrix(
        q + 10 ** rng.uniform(-16, -3) * rng.normal(size=3) * rng.integers(0, 2, 3), actuator
    )


def small_integers(rng, actuator):
    return rng.integers(-1, 2, (3, 18)).astype(float)


def any_number_of_groups(rng, actuator):
    return rng.normal(size=(3, rng.integers(3, 40)))


MATRICES = [
    pose_matrix,
    dead_groups,
    repeated_columns,
    nearly_repeated_columns,
    symmetric_pose,
    nearly_symmetric_pose,
    small_integers,
    any_number_of_groups,
]


def along_anything(rng, G):
    return rng.normal(size=3)


def along_a_column(rng, G):
    return G[:, np.linalg.norm(G, axis=0).argmax()] * rng.choice([-1.0, 1.0])


def along_an_axis(rng, G):
    return np.eye(3)[rng.integers(3)]


CASES_EACH = 420  # times 8 kinds of matrix and 3 of direction: 10,080 in all


@pytest.mark.parametrize("matrix", MATRICES)
@pytest.mark.parametrize("direction", [along_anything, along_a_column, along_an_axis])
def test_scale_is_that_of_the_linear_programme(actuator, matrix, direction):
    rng = np.random.default_rng(1)
    acted = 0
    for _ in range(CASES_EACH):
        G = matrix(rng, actuator)
        if np.linalg.matrix_rank(G, tol=1e-3 * np.abs(G).max()) < 3:
            continue
        limit = 10 ** rng.uniform(-6, 3)
        torque = at_multiple(G, direction(rng, G), 10 ** rng.uniform(-1, np.log10(5)), limit)
        scale, current = bounded(G, torque, limit)
        largest = largest_by_programme(G, torque, limit)
        assert largest == pytest.approx(limit * largest_by_facets(G, torque), rel=1e-9)
        assert scale == pytest.approx(min(largest, 1.0), rel=1e-9)
        assert np.abs(current).max() <= limit
        np.testing.assert_allclose(G @ current, scale * torque, rtol=0, atol=1e-9 * np.linalg.norm(torque))
        acted += scale < 1
    assert acted >= 5


@given(q=poses, direction=directions, multiple=multiples)
def test_any_pose_keeps_limit_direction_and_the_lead_on_least_norm(actuator, q, direction, multiple):
    G = torque_matrix(q, actuator)
    torque = at_multiple(G, direction, multiple)
    scale, current = bounded(G, torque)
    plain_scale, plain = least_norm(G, torque)
    assert plain_scale * (1 - 1e-12) <= scale <= 1
    assert np.abs(current).max() <= LIMIT
    np.testing.assert_allclose(G @ current, scale * torque, rtol=0, atol=1e-9 * np.linalg.norm(torque))
    if plain_scale == 1:
        assert scale == 1
        np.testing.assert_array_equal(current, plain)


@given(q=poses, direction=directions, multiple=multiples)
def test_currents_within_reach_are_the_smallest(actuator, q, direction, multiple):
    """With some y, ``I = clip(G^T y)``: sufficient for the least norm, the problem being convex."""
    G = torque_matrix(q, actuator)
    scale, current = bounded(G, at_multiple(G, direction, multiple))
    free = np.abs(current) < LIMIT * (1 - 1e-9)
    if scale < 1 or np.linalg.matrix_rank(G[:, free]) < 3:
        return
    y = np.linalg.lstsq(G[:, free].T, current[free])[0]
    np.testing.assert_allclose(np.clip(G.T @ y, -LIMIT, LIMIT), current, atol=1e-6)


def test_norm_is_that_of_a_general_solver(actuator):
    rng = np.random.default_rng(2)
    compared = 0
    while compared < 10:
        G = pose_matrix(rng, actuator)
        torque = at_multiple(G, rng.normal(size=3), 1.3)
        scale, current = bounded(G, torque)
        if scale < 1:
            continue
        size = np.abs(G).max()
        found = minimize(
            lambda z: 0.5 * z @ z,
            current / LIMIT + 0.1 * rng.normal(size=18),
            jac=lambda z: z,
            bounds=[(-1, 1)] * 18,
            constraints={
                "type": "eq",
                "fun": lambda z, G=G, torque=torque, size=size: (G @ z - torque / LIMIT) / size,
                "jac": lambda z, G=G, size=size: G / size,
            },
            method="SLSQP",
            options={"ftol": 1e-12, "maxiter": 300},
        )
        assert found.success
        np.testing.assert_allclose(current / LIMIT, found.x, atol=1e-5)
        compared += 1


def test_currents_are_continuous_where_the_torque_passes_out_of_reach(actuator):
    rng = np.random.default_rng(3)
    for _ in range(50):
        G = pose_matrix(rng, actuator)
        torque = at_multiple(G, rng.normal(size=3), 10.0)
        scale, out_of_reach = bounded(G, torque)
        assert scale < 1
        within, smallest = bounded(G, torque * scale * (1 - 1e-9))
        assert within == 1
        # The steepest group seen goes from limit to limit within 1e-6 of the torque.
        np.testing.assert_allclose(out_of_reach, smallest, atol=0.05)
        assert bounded(G, torque * scale * (1 + 1e-9))[1] == pytest.approx(out_of_reach, abs=1e-6)


def test_currents_jump_with_the_pose_out_of_reach_and_not_three_hundredths_within(actuator):
    q, turn = np.array([0.3, -0.2, 0.1]), np.array([0.1, 0.2, 0.5])
    torque = np.array([0.9, -1.8, 1.2])
    edge, within = [], []
    for part in np.linspace(0, 1, 2001):
        G = torque_matrix(q + turn * part, actuator)
        scale, current = bounded(G, torque)
        assert scale < 1
        edge.append(current)
        within.append(bounded(G, 0.97 * scale * torque)[1])
        assert np.linalg.norm(within[-1]) < np.linalg.norm(current)
    jumps = [np.abs(np.diff(currents, axis=0)).max() for currents in (edge, within)]
    assert jumps[1] < 1.0 < 8.0 < jumps[0]


@pytest.mark.parametrize("tilt_deg", [12, 20, 30])
def test_worst_torque_is_half_as_large_again_as_the_least_norm_one(actuator, tilt_deg):
    """Sampled factors are 1.7 at 12 degrees and 1.9 at 20 and 30."""
    i = np.arange(150) + 0.5  # directions spread evenly over a sphere
    z, turn = 1 - i / 75, np.pi * (1 + 5**0.5) * i
    directions = np.column_stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z])
    sine = np.sin(np.deg2rad(tilt_deg))
    worst = np.full(2, np.inf)
    for azimuth in np.arange(12) * np.pi / 6:
        beta = np.arcsin(sine * np.cos(azimuth))
        alpha = -np.arcsin(sine * np.sin(azimuth) / np.cos(beta))
        for gamma in np.arange(4) * np.pi / 8:
            q = np.array([alpha, beta, gamma])
            assert rotation(q)[2, 2] == pytest.approx(np.cos(np.deg2rad(tilt_deg)))
            G = torque_matrix(q, actuator)
            for direction in directions:
                torque = 100.0 * direction
                reached = 100.0 * np.array([least_norm(G, torque)[0], bounded(G, torque)[0]])
                worst = np.minimum(worst, reached)
    assert worst[1] >= 1.5 * worst[0]


def beyond_reach(rng, matrix, actuator):
    """Matrix, what least-norm currents give of a torque, in limits, and the largest multiple of that."""
    while True:
        G = matrix(rng, actuator)
        direction = rng.normal(size=3) if rng.random() < 0.5 else along_an_axis(rng, G)
        if np.linalg.matrix_rank(G, tol=1e-3 * np.abs(G).max()) == 3:
            start = at_multiple(G, direction, 1.0, 1.0)
            return np.ascontiguousarray(G), tuple(start), largest_by_facets(G, start)


@pytest.mark.parametrize("matrix", [pose_matrix, dead_groups, symmetric_pose, small_integers])
def test_path_ends_well_within_its_steps_and_may_be_left_at_any(actuator, matrix):
    rng = np.random.default_rng(5)
    for _ in range(40):
        G, start, largest = beyond_reach(rng, matrix, actuator)
        groups = G.shape[1]
        scratch = np.empty((SCRATCH_ROWS, groups))
        found, _, needed = follow_path(G, start, 1e9, STEPS_PER_GROUP * groups, scratch)
        assert found == pytest.approx(largest, rel=1e-9)
        assert needed <= 1.5 * groups
        before = 0.0
        for steps in range(1, needed + 1):
            share, _, taken = follow_path(G, start, 1e9, steps, scratch)
            assert taken == steps
            assert share >= before * (1 - 1e-9)
            assert np.abs(scratch[0]).max() <= 1
            np.testing.assert_allclose(
                G @ scratch[0], np.multiply(share, start), rtol=0, atol=1e-9 * share * np.linalg.norm(start)
            )
            before = share


@pytest.mark.parametrize("matrix", MATRICES)
def test_the_way_out_of_a_lost_path_reaches_the_largest_torque_alone(actuator, matrix):
    rng = np.random.default_rng(6)
    for _ in range(40):
        G, start, largest = beyond_reach(rng, matrix, actuator)
        demand = np.zeros(G.shape[1])
        share, steps = climb(G, start, 1e9, 0.0, 1000, demand)
        assert share == pytest.approx(largest, rel=1e-9)
        assert steps <= STEPS_PER_GROUP * G.shape[1]
        assert np.abs(demand).max() <= 1 + 1e-9
        np.testing.assert_allclose(
            G @ demand, np.multiply(share, start), rtol=0, atol=1e-9 * share * np.linalg.norm(start)
        )
        demand[:] = 0.0
        assert climb(G, start, 0.7 * largest, 0.0, 1000, demand)[0] == 0.7 * largest
        np.testing.assert_allclose(
            G @ demand, np.multiply(0.7 * largest, start), rtol=0, atol=1e-9 * share * np.linalg.norm(start)
        )


def test_lost_direction_gives_no_current():
    G = np.zeros((3, 18))
    G[:2] = np.random.default_rng(0).normal(size=(2, 18))
    for torque in ([0.1, 0.2, 0.3], [1e3, 0.0, 0.0]):
        scale, current = bounded(G, np.array(torque))
        assert scale == 0
        np.testing.assert_array_equal(current, np.zeros(18))


def test_no_torque_needs_no_current(actuator):
    G = torque_matrix(np.zeros(3), actuator)
    scale, current = bounded(G, np.zeros(3))
    assert scale == 1
    np.testing.assert_array_equal(current, np.zeros(18))
    assert bounded(G, np.array([1e-300, 0.0, 0.0]))[0] == 1


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
    scale, current = bounded(numbers[:54].reshape(3, 18), numbers[54:], limit)
    assert 0 <= scale <= 1
    assert np.isfinite(current).all()
    assert scale == 0 or np.abs(current).max() <= limit
    if scale == 0:
        assert not current.any()
