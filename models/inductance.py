"""Mutual inductance of the coil groups, computed from the geometry of the coils.

Neumann's integral ``M = µ0/4π ∮∮ dl1·dl2 / |p1 - p2|`` of two circular filaments, averaged over the winding
sections of both coils and multiplied by the square of the turns. All axes pass through the joint centre at
one distance, so that M depends only on the angle between two axes. The integrand is smooth: Gauss-Legendre
points over the section and equal steps around converge quickly.
"""

from __future__ import annotations

from functools import lru_cache
from math import pi

import numpy as np

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.cache import cached_array
from spheretwin.models.magnet_and_coil import CoilGeometry

MU0_OVER_4PI = 1e-7

RADIAL, AXIAL, AROUND = 4, 6, 24
"""Points of a coil: twice as many change M of neighbours (26.4°, 0.5 mm apart) by 4e-5 of itself."""

# Angles between axes come from rotations, with errors of 1e-15.
SAME_COSINE = 9


@lru_cache(maxsize=8)
def mutual_inductance(actuator: Actuator) -> Array:
    """Return the mutual inductance of all groups, (n, n) in H, with zeros on the diagonal.

    A positive current in a group runs about the outward axis of each coil as `coil_direction` states. The
    result is cached in memory and in the cache folder, under the geometry that it was computed from.
    """
    coil, groups = actuator.coil, actuator.groups
    geometry = (
        coil.inner_radius_m,
        coil.outer_radius_m,
        coil.length_m,
        coil.distance_m,
        coil.turns,
    )
    key = (
        b"mutual inductance"
        + np.array(geometry).tobytes()
        + b"".join(part.tobytes() for part in (actuator.coil_axes, actuator.coil_direction, groups))
    )
    return cached_array(key, lambda: _all_groups(actuator))


def _all_groups(actuator: Actuator) -> Array:
    """Return the mutual inductance of all groups: the sum over the pairs of their coils."""
    cosines = np.clip(np.round(actuator.coil_axes @ actuator.coil_axes.T, SAME_COSINE), -1, 1)
    different, places = np.unique(cosines, return_inverse=True)
    values = [coil_pair(actuator.coil, np.arccos(c)) if c < 1 else 0.0 for c in different]
    of_coils = np.array(values)[places].reshape(cosines.shape)
    of_coils *= np.outer(actuator.coil_direction, actuator.coil_direction)
    members = actuator.groups.T
    of_groups = sum(of_coils[np.ix_(a, b)] for a in members for b in members)
    return np.asarray(of_groups * (1 - np.eye(len(actuator.groups))))


def coil_pair(coil: CoilGeometry, angle_rad: float) -> float:
    """Return the mutual inductance (H) of two equal coils whose axes enclose an angle (rad)."""
    points, elements = filaments(coil)
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    others = rotation @ points
    squares = (points**2).sum(axis=0)
    distance = np.sqrt(squares[:, None] + squares - 2 * points.T @ others)
    return float(MU0_OVER_4PI * coil.turns**2 * np.sum(elements.T @ (rotation @ elements) / distance))


def filaments(coil: CoilGeometry) -> tuple[Array, Array]:
    """Return points of the winding of a coil whose axis is z, and their conductor elements, (3, m), m.

    The elements are those of a single turn, spread over the section.
    """
    radius, radial = _gauss(RADIAL, coil.inner_radius_m, coil.outer_radius_m)
    height, axial = _gauss(AXIAL, coil.distance_m - coil.length_m / 2, coil.distance_m + coil.length_m / 2)
    turn = 2 * pi * np.arange(AROUND) / AROUND
    r, z, psi = (part.ravel() for part in np.meshgrid(radius, height, turn, indexing="ij"))
    shares = np.repeat(np.outer(radial, axial).ravel(), AROUND) * r * (2 * pi / AROUND)
    points = np.array([r * np.cos(psi), r * np.sin(psi), z])  # (3, m)
    elements = shares * np.array([-np.sin(psi), np.cos(psi), 0 * psi])  # (3, m)
    return points, elements


def _gauss(points: int, first: float, last: float) -> tuple[Array, Array]:
    """Return Gauss-Legendre points between two ends, and their shares."""
    nodes, weights = np.polynomial.legendre.leggauss(points)
    return first + (last - first) * (nodes + 1) / 2, weights / 2
