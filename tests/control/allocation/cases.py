"""Matrices and torques of every kind for the bounded allocation, and the share of each that can be had."""

from itertools import combinations

import numpy as np
from scipy.optimize import linprog

from spheretwin.control.allocation.bounded import SCRATCH_ROWS, allocate_bounded
from spheretwin.control.allocation.least_norm import allocate
from spheretwin.models.magnetics import torque_matrix

LIMIT = 8.0
TILT = np.deg2rad(80)
LOST = 1e-3  # share of the largest entry below which a direction is not compared: it is nearly lost


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


DIRECTIONS = [along_anything, along_a_column, along_an_axis]


def of_full_rank(rng, matrix, actuator):
    """A matrix of some kind in which no direction is nearly lost."""
    while True:
        G = matrix(rng, actuator)
        if np.linalg.matrix_rank(G, tol=LOST * np.abs(G).max()) == 3:
            return np.ascontiguousarray(G)
