"""Making solids out of solids: revolve, repeat, join."""

from collections.abc import Iterable

import numpy as np
from manifold3d import CrossSection, FillRule, Manifold, OpType
from numpy.typing import NDArray


def revolve(outline: Iterable[tuple[float, float]], sections: int) -> Manifold:
    """Solid of revolution about z of an outline of points (distance from z, height)."""
    return Manifold.revolve(section(outline), sections)


def around(solid: Manifold, count: int, first_deg: float = 0.0) -> Manifold:
    """Copies of a solid, evenly spaced about z."""
    return union(solid.rotate([0.0, 0.0, first_deg + 360.0 * i / count]) for i in range(count))


def along(solid: Manifold, axes: NDArray[np.float64], distance: float = 0.0) -> Manifold:
    """Copies of a solid, its z turned to each of some unit vectors.

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
    """Cylinder about z between two heights."""
    return Manifold.cylinder(high - low, radius, radius, sections).translate([0, 0, low])


def both(axis: str) -> NDArray[np.float64]:
    """Both directions along one of the axes x, y, z."""
    direction = np.eye(3)["xyz".index(axis)]
    return np.array([direction, -direction])


def union(solids: Iterable[Manifold]) -> Manifold:
    """One solid of several."""
    return Manifold.batch_boolean(list(solids), OpType.Add)


def section(outline: Iterable[tuple[float, float]]) -> CrossSection:
    """Plane figure inside an outline of points."""
    return CrossSection([np.array(list(outline), dtype=float)], FillRule.NonZero)
