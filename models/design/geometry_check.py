"""Geometry check: overlap of coils in the stator, of poles in the rotor, and the air gap."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator, from_model
from spheretwin.models.base.errors import InputError
from spheretwin.models.curve_origin import disagreements
from spheretwin.models.magnet_and_coil import CoilGeometry, Magnet
from spheretwin.models.mjcf import read
from spheretwin.models.torque_curve import TorqueCurve

# Cylinders that touch by design differ by rounding alone.
TOUCHING_M = 1e-9


class Overlap(NamedTuple):
    """Two cylinders that overlap."""

    part: str
    """``coil`` or ``pole``."""
    first: int
    second: int
    """Indices into the actuator's axes."""
    depth_m: float
    """Distance by which the two would have to separate."""


def overlaps(actuator: Actuator) -> list[Overlap]:
    """Return pairs of coils and pairs of poles that overlap, deepest first.

    Parameters
    ----------
    actuator : Actuator
        Axes of its coils and poles, and their common sizes.
    """
    pairs = [
        *_overlaps("coil", actuator.coil_axes, actuator.coil, actuator.coil.outer_radius_m),
        *_overlaps("pole", actuator.pole_axes, actuator.magnet, actuator.magnet.radius_m),
    ]
    return sorted(pairs, key=lambda pair: (-round(pair.depth_m / TOUCHING_M), pair.part, pair.first))


def air_gap_m(actuator: Actuator) -> float:
    """Return the air gap between the rotating rotor and the faces of the coils, m; negative if they collide.

    The rotor is the ball through the farthest points of the poles: the whole front of a pole that is ground
    to the ball, the rim of a flat one.
    """
    return actuator.coil.distance_m - actuator.coil.length_m / 2 - actuator.magnet.reach_m


def clearance(axes: NDArray[np.float64], radius_m: float, length_m: float, distance_m: float) -> NDArray:
    """Return the clearance of equal cylinders whose axes meet at the centre, m; negative if they overlap.

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
    It is exact for the question whether they overlap: the two are mirror images in that plane, and a convex
    body meets its mirror image only at the mirror. A cylinder reaches it first with its inner edge, so that
    the front may be ground.
    """
    cosine = np.clip(axes @ axes.T, -1.0, 1.0)
    sine_half, cosine_half = np.sqrt((1 - cosine) / 2), np.sqrt((1 + cosine) / 2)
    return 2 * ((distance_m - length_m / 2) * sine_half - radius_m * cosine_half)


def _overlaps(
    part: str, axes: NDArray[np.float64], size: CoilGeometry | Magnet, radius_m: float
) -> list[Overlap]:
    room = clearance(axes, radius_m, size.length_m, size.distance_m)
    first, second = np.nonzero(np.triu(room < -TOUCHING_M, k=1))
    return [Overlap(part, int(i), int(j), float(-room[i, j])) for i, j in zip(first, second, strict=True)]


def of_model_file(mjcf: Path, curve: TorqueCurve) -> list[str]:
    """Return warnings for a model file, which may lack parts that the torque curve does not need.

    Parameters
    ----------
    mjcf : Path
        Model file.
    curve : TorqueCurve
        Compared with the model, or computed from it.
    """
    try:
        return of_geometry(from_model(read(mjcf).described, curve))
    except InputError:
        return []


def of_geometry(actuator: Actuator) -> list[str]:
    """Return warnings of overlaps, then of differences from the geometry of the torque curve."""
    return [*of_parts(actuator), *disagreements(actuator)]


def of_parts(actuator: Actuator) -> list[str]:
    """Return warnings of overlaps: coils, poles (the deepest pair each), coils and the ball."""
    all_overlaps = overlaps(actuator)
    lines = []
    for part, axes in (("coil", actuator.coil_axes), ("pole", actuator.pole_axes)):
        pairs = [overlap for overlap in all_overlaps if overlap.part == part]
        if pairs:
            lines.append(_line(pairs, axes))
    if (gap_m := air_gap_m(actuator)) < 0:
        lines.append(f"the coils' faces reach {-1e3 * gap_m:.2g} mm into the ball that the poles sweep")
    return lines


def _line(pairs: list[Overlap], axes: NDArray[np.float64]) -> str:
    deepest = pairs[0]
    first, second = (_place(deepest.part, i, axes) for i in (deepest.first, deepest.second))
    more = f", and {len(pairs) - 1} more pairs" if len(pairs) > 1 else ""
    return f"{first} and {second} overlap by {1e3 * deepest.depth_m:.2g} mm{more}"


def _place(part: str, index: int, axes: NDArray[np.float64]) -> str:
    x, y, z = axes[index]
    latitude, azimuth = np.degrees(np.arcsin(np.clip(z, -1.0, 1.0))), np.degrees(np.arctan2(y, x))
    return f"{part} {index} (latitude {latitude:.0f}°, azimuth {azimuth % 360:.0f}°)"
