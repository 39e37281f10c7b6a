"""Solids: revolution, repetition, union, and shapes shared by several parts, in metres."""

from collections.abc import Iterable

import numpy as np
from manifold3d import CrossSection, FillRule, Manifold, OpType
from numpy.typing import NDArray

MM = 1e-3

# Resolution of circles, by the size of the part.
SECTIONS = 48
SMALL_SECTIONS = 32
PIN_SECTIONS = 24
HOLE_SECTIONS = 16
ARC_STEP_DEG = 7.5

RING_CHAMFER_M = 0.5 * MM

Points = list[tuple[float, float]]


def revolve(outline: Iterable[tuple[float, float]], sections: int) -> Manifold:
    """Return the solid of revolution about z of an outline of points (distance from z, height)."""
    return Manifold.revolve(section(outline), sections)


def around(solid: Manifold, count: int, first_deg: float = 0.0) -> Manifold:
    """Return copies of a solid, evenly spaced about z."""
    return union(solid.rotate([0.0, 0.0, first_deg + 360.0 * i / count]) for i in range(count))


def along(solid: Manifold, axes: NDArray[np.float64], distance: float = 0.0) -> Manifold:
    """Return copies of a solid, with its z axis rotated to each of the given unit vectors.

    Parameters
    ----------
    solid : Manifold
        In its own frame.
    axes : (n, 3) array
        Unit vectors.
    distance : float, m
        Of the copies' origins from the centre, outward along the axes.
    """
    polar = np.degrees(np.arccos(np.clip(axes[:, 2], -1.0, 1.0)))
    azimuth = np.degrees(np.arctan2(axes[:, 1], axes[:, 0]))
    placed = solid.translate([0.0, 0.0, distance])
    return union(placed.rotate([0.0, p, a]) for p, a in zip(polar, azimuth, strict=True))


def cylinder(radius: float, low: float, high: float, sections: int) -> Manifold:
    """Return a cylinder about z between two heights."""
    return Manifold.cylinder(high - low, radius, radius, sections).translate([0, 0, low])


def both(axis: str) -> NDArray[np.float64]:
    """Return both directions along one of the axes x, y, z."""
    direction = np.eye(3)["xyz".index(axis)]
    return np.array([direction, -direction])


def union(solids: Iterable[Manifold]) -> Manifold:
    """Return the union of solids."""
    return Manifold.batch_boolean(list(solids), OpType.Add)


def section(outline: Iterable[tuple[float, float]]) -> CrossSection:
    """Return the plane figure inside an outline of points."""
    return CrossSection([np.array(list(outline), dtype=float)], FillRule.NonZero)


def flat_ring(inner: float, outer: float, half_height: float) -> Manifold:
    """Return a flat ring about z with chamfered edges."""
    c, h = RING_CHAMFER_M, half_height
    return revolve(
        [
            (inner, -h + c),
            (inner + c, -h),
            (outer - c, -h),
            (outer, -h + c),
            (outer, h - c),
            (outer - c, h),
            (inner + c, h),
            (inner, h - c),
        ],
        SECTIONS,
    )


def spherical_shell(inner: float, outer: float, lowest_deg: float, highest_deg: float) -> Manifold:
    """Return a spherical shell between two latitudes, with rims cut towards the centre."""
    steps = max(1, round((highest_deg - lowest_deg) / ARC_STEP_DEG))
    latitude = np.radians(np.linspace(lowest_deg, highest_deg, steps + 1))
    circle = np.column_stack([np.cos(latitude), np.sin(latitude)])
    return revolve([*map(tuple, outer * circle), *map(tuple, inner * circle[::-1])], SECTIONS)


def tube(inner: float, outer: float, low: float, high: float) -> Manifold:
    """Return a hollow cylinder about z between two heights."""
    return revolve([(inner, low), (outer, low), (outer, high), (inner, high)], SECTIONS)


def chamfered_pin(radius: float, low: float, high: float) -> Manifold:
    """Return a cylinder about z between two heights, with a chamfered upper edge."""
    c = RING_CHAMFER_M
    return revolve(
        [(0.0, low), (radius, low), (radius, high - c), (radius - c, high), (0.0, high)], PIN_SECTIONS
    )
