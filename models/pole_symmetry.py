"""Symmetry of the poles: the rotations of the rotor that no sensor of its field can tell apart."""

from __future__ import annotations

from itertools import permutations
from math import atan2, pi

import numpy as np

from spheretwin.models.base.arrays import Array

SAME = 1e-6
"""Distance of two unit vectors that count as one: axes from degrees have errors of 1e-15."""


def symmetry_rotations(axes: Array, polarity: Array) -> Array:
    """Return all rotations that map each pole onto one of the same polarity, (n, 3, 3), the identity first.

    They map one pair of poles onto each of its images; every rotation of them that maps all poles is one.

    Parameters
    ----------
    axes : (p, 3) array
        Unit vectors of at least two poles that are not collinear.
    polarity : (p,) array

    Raises
    ------
    ValueError
        All poles are on one line: they have infinitely many symmetries.
    """
    across = np.linalg.norm(np.cross(axes[0], axes), axis=1)
    if not across.max() > SAME:
        raise ValueError("expected poles on two axes, received all on one line")
    other = int(np.argmax(across))
    frame = _frame(axes[0], axes[other])
    rotations = [np.eye(3)]
    for a, b in permutations(range(len(axes)), 2):
        pair = polarity[a] == polarity[0] and polarity[b] == polarity[other]
        if pair and abs(axes[a] @ axes[b] - axes[0] @ axes[other]) < SAME:
            R = _frame(axes[a], axes[b]) @ frame.T
            new = all(np.linalg.norm(R - known) > SAME for known in rotations)
            if new and _maps(R, axes, polarity):
                rotations.append(R)
    return np.array(rotations)


def turn_period_rad(rotations: Array) -> float:
    """Return the smallest turn about the z axis of the rotor among rotations, rad; 2π if there is none."""
    about_z = rotations[np.abs(rotations[:, 2, 2] - 1) < SAME]
    turns = [atan2(R[1, 0], R[0, 0]) % (2 * pi) for R in about_z[:, :2, :2]]
    return min((turn for turn in turns if SAME < turn < 2 * pi - SAME), default=2 * pi)


def _frame(first: Array, second: Array) -> Array:
    """Return the frame of two directions, with its axes as columns."""
    normal = np.cross(first, second)
    normal /= np.linalg.norm(normal)
    return np.column_stack([first, normal, np.cross(first, normal)])


def _maps(R: Array, axes: Array, polarity: Array) -> bool:
    distance = np.linalg.norm((axes @ R.T)[:, None] - axes, axis=2)
    images = distance.argmin(axis=1)
    return bool(np.all(distance.min(axis=1) < SAME) and np.all(polarity[images] == polarity))
