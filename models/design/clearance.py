"""Whether the parts fit: coils beside coils in the stator, poles beside poles in the rotor."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator, Coil, Magnet

# Cylinders drawn to touch differ by rounding alone.
TOUCHING_M = 1e-9


class Overlap(NamedTuple):
    """Two cylinders that share room."""

    part: str
    """``coil`` or ``pole``."""
    first: int
    second: int
    """Indices into the actuator's axes."""
    depth_m: float
    """How far the two would have to part."""


def overlaps(actuator: Actuator) -> list[Overlap]:
    """Pairs of coils and pairs of poles that overlap, deepest first.

    Parameters
    ----------
    actuator : Actuator
        Axes of its coils and poles, and their common sizes.
    """
    found = [
        *_overlaps("coil", actuator.coil_axes, actuator.coil, actuator.coil.outer_radius_m),
        *_overlaps("pole", actuator.pole_axes, actuator.magnet, actuator.magnet.radius_m),
    ]
    return sorted(found, key=lambda pair: (-round(pair.depth_m / TOUCHING_M), pair.part, pair.first))


def air_gap_m(actuator: Actuator) -> float:
    """Room between the turning rotor and the coils' faces, m; negative where the rotor cannot turn.

    The rotor is the ball through the farthest points of the poles: the whole front of a pole that is ground
    to the ball, the rim of a flat one.
    """
    return actuator.coil.distance_m - actuator.coil.length_m / 2 - actuator.magnet.reach_m


def clearance(axes: NDArray[np.float64], radius_m: float, length_m: float, distance_m: float) -> NDArray:
    """Room between equal cylinders whose axes meet at the centre, m; negative where they overlap.

    Parameters
    ----------
    axes : (n, 3) array
        Unit vectors.
    radius_m, length_m, distance_m : float, m
        Of each cylinder; the distance is that of its middle from the centre.

    Returns
    -------
    (n, n) array, m
        Width of the slab between two cylinders, parallel to the plane midway between their axes.

    Notes
    -----
    Exact for the question whether they overlap: the two are mirror images in that plane, and a convex
    body meets its mirror image only where it reaches the mirror. A cylinder does so first with its inner
    edge, so that a front may be ground.
    """
    cosine = np.clip(axes @ axes.T, -1.0, 1.0)
    sine_half, cosine_half = np.sqrt((1 - cosine) / 2), np.sqrt((1 + cosine) / 2)
    return 2 * ((distance_m - length_m / 2) * sine_half - radius_m * cosine_half)


def _overlaps(part: str, axes: NDArray[np.float64], size: Coil | Magnet, radius_m: float) -> list[Overlap]:
    room = clearance(axes, radius_m, size.length_m, size.distance_m)
    first, second = np.nonzero(np.triu(room < -TOUCHING_M, k=1))
    return [Overlap(part, int(i), int(j), float(-room[i, j])) for i, j in zip(first, second, strict=True)]
