"""Triangles with normals: what a drawn solid is made of, how it is turned, moved and joined."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array


@dataclass(frozen=True)
class Surface:
    """A mesh with one normal a vertex."""

    positions: NDArray[np.float32]  # (n, 3) m
    normals: NDArray[np.float32]  # (n, 3)
    triangles: NDArray[np.int64]  # (m, 3), counter-clockwise from outside

    def placed(self, rotation: Array, translation: Array) -> Surface:
        """Return the surface rotated and then translated."""
        positions = self.positions @ rotation.T + translation
        normals = self.normals @ rotation.T
        return Surface(positions.astype(np.float32), normals.astype(np.float32), self.triangles)


def merged_surface(surfaces: list[Surface]) -> Surface:
    """Several as one, in their order."""
    first = np.cumsum([0] + [len(part.positions) for part in surfaces[:-1]])
    return Surface(
        np.concatenate([part.positions for part in surfaces]),
        np.concatenate([part.normals for part in surfaces]),
        np.concatenate([part.triangles + start for part, start in zip(surfaces, first, strict=True)]),
    )


def revolved_surface(outline: list[tuple[float, float]], sections: int) -> Surface:
    """Solid of revolution about z, with an edge at each corner of its outline.

    Parameters
    ----------
    outline : list of (float, float), m
        Corners, distance from z and height, the solid on their left.
    sections : int
        Sections of a circle.
    """
    corners = np.array(outline)
    return merged_surface([_band(*ends, sections) for ends in pairwise(corners)])


def _band(first: Array, last: Array, sections: int) -> Surface:
    """Return the surface that a segment between two corners sweeps."""
    angle = 2 * np.pi * np.arange(sections) / sections
    along = (last - first) / np.linalg.norm(last - first)
    outward = _circle(np.array([along[1], -along[0]]), angle)
    here = np.arange(sections)
    there = np.roll(here, -1)
    lower = np.stack([here, there, there + sections], axis=1)
    upper = np.stack([here, there + sections, here + sections], axis=1)
    return Surface(
        np.concatenate([_circle(first, angle), _circle(last, angle)]),
        np.concatenate([outward, outward]),
        np.concatenate([lower, upper]),
    )


def _circle(point: Array, angle: Array) -> NDArray[np.float32]:
    """A point (distance from z, height) carried around z: (angles, 3)."""
    distance, height = point
    points = [distance * np.cos(angle), distance * np.sin(angle), height + 0 * angle]
    return np.stack(points, axis=1).astype(np.float32)


def tube(inner: float, outer: float, low: float, high: float, sections: int) -> Surface:
    """Hollow cylinder about z between two heights."""
    return revolved_surface(
        [(inner, low), (outer, low), (outer, high), (inner, high), (inner, low)], sections
    )


def cylinder(radius: float, low: float, high: float, sections: int) -> Surface:
    """Cylinder about z between two heights."""
    return revolved_surface([(0.0, low), (radius, low), (radius, high), (0.0, high)], sections)


def zone(radius: float, low: float, high: float, steps: int, sections: int) -> Surface:
    """Part of a sphere between two heights, smooth in both directions."""
    latitudes = np.linspace(np.arcsin(low / radius), np.arcsin(high / radius), steps + 1)
    angles = np.linspace(0.0, 2 * np.pi, sections + 1)
    latitude, angle = (grid.ravel() for grid in np.meshgrid(latitudes, angles, indexing="ij"))
    across = np.cos(latitude)
    normals = np.stack([across * np.cos(angle), across * np.sin(angle), np.sin(latitude)], axis=1)
    corner = np.arange(len(normals)).reshape(steps + 1, sections + 1)
    a, b, c, d = (
        part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1])
    )
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Surface((radius * normals).astype(np.float32), normals.astype(np.float32), triangles)


def bar(lengths: tuple[float, float, float]) -> Surface:
    """Box about the origin."""
    square = np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], dtype=np.float32)
    top = Surface(
        square, np.tile(np.array([0, 0, 1], dtype=np.float32), (4, 1)), np.array([[0, 1, 2], [0, 2, 3]])
    )
    # Each pair of sides is the first with its axes in cyclic order; the far side is its mirror image.
    near = [top.placed(np.roll(np.eye(3), shift, axis=0), np.zeros(3)) for shift in range(3)]
    far = [Surface(-side.positions, -side.normals, side.triangles[:, ::-1]) for side in near]
    box = merged_surface([*near, *far])
    return Surface(box.positions * np.float32(np.array(lengths) / 2), box.normals, box.triangles)


def reversed_(surface: Surface) -> Surface:
    """Return the surface turned inside out."""
    return Surface(surface.positions, -surface.normals, surface.triangles[:, ::-1])
