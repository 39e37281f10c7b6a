"""Whether the parts fit: coils beside coils in the stator, poles beside poles in the rotor."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator, CoilGeometry, Magnet, from_model
from spheretwin.models.base.errors import InputError
from spheretwin.models.magnetics import disagreements
from spheretwin.models.mjcf import read
from spheretwin.models.torque_curve import TorqueCurve

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
    pairs = [
        *_overlaps("coil", actuator.coil_axes, actuator.coil, actuator.coil.outer_radius_m),
        *_overlaps("pole", actuator.pole_axes, actuator.magnet, actuator.magnet.radius_m),
    ]
    return sorted(pairs, key=lambda pair: (-round(pair.depth_m / TOUCHING_M), pair.part, pair.first))


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


def _overlaps(
    part: str, axes: NDArray[np.float64], size: CoilGeometry | Magnet, radius_m: float
) -> list[Overlap]:
    room = clearance(axes, radius_m, size.length_m, size.distance_m)
    first, second = np.nonzero(np.triu(room < -TOUCHING_M, k=1))
    return [Overlap(part, int(i), int(j), float(-room[i, j])) for i, j in zip(first, second, strict=True)]


def of_model_file(mjcf: Path, curve: TorqueCurve) -> list[str]:
    """Warnings for a model file that may still lack what the torque curve does not need.

    Parameters
    ----------
    mjcf : Path
        Model file.
    curve : TorqueCurve
        Held against it, or just computed from it.
    """
    try:
        return of_geometry(from_model(read(mjcf).described, curve))
    except InputError:
        return []


def of_geometry(actuator: Actuator) -> list[str]:
    """Parts that overlap, then numbers that differ from what the torque curve was computed for."""
    return [*of_parts(actuator), *disagreements(actuator)]


def of_parts(actuator: Actuator) -> list[str]:
    """Parts that overlap: coils and the ball, coils and coils, poles and poles (the deepest pair)."""
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
