"""Triangles with normals: what a drawn solid is made of, how it is turned, moved and joined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import pi

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
    around = [distance * np.cos(angle), distance * np.sin(angle), height + 0 * angle]
    return np.stack(around, axis=1).astype(np.float32)


@dataclass(frozen=True)
class Solid:
    """A mesh whose vertices are shared only where its surface is smooth."""

    vertices: NDArray[np.float32]  # (n, 3) m
    faces: NDArray[np.uint32]  # (m, 3)


def revolved_solid(outline: Sequence[tuple[float, float]], sections: int) -> Solid:
    """Surface of revolution about z.

    Parameters
    ----------
    outline : sequence of (float, float), m
        Points (distance from z, height), upward on the outside.
    sections : int
        Around z.
    """
    angles = np.linspace(0.0, 2 * pi, sections + 1)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return merged_solid([_strip(circle, *ends) for ends in pairwise(outline)])


def tube(inner: float, outer: float, low: float, high: float, sections: int) -> Solid:
    """Hollow cylinder about z between two heights."""
    return revolved_solid([(inner, low), (outer, low), (outer, high), (inner, high), (inner, low)], sections)


def cylinder(radius: float, low: float, high: float, sections: int) -> Solid:
    """Cylinder about z between two heights."""
    return revolved_solid([(0.0, low), (radius, low), (radius, high), (0.0, high)], sections)


def zone(radius: float, low: float, high: float, steps: int, sections: int) -> Solid:
    """Part of a sphere between two heights, smooth in both directions."""
    latitudes = np.linspace(np.arcsin(low / radius), np.arcsin(high / radius), steps + 1)
    angles = np.linspace(0.0, 2 * pi, sections + 1)
    latitude, angle = np.meshgrid(latitudes, angles, indexing="ij")
    across = radius * np.cos(latitude)
    points = np.stack([across * np.cos(angle), across * np.sin(angle), radius * np.sin(latitude)], axis=-1)
    return Solid(points.reshape(-1, 3).astype(np.float32), _grid(steps + 1, sections + 1))


def merged_solid(solids: Sequence[Solid]) -> Solid:
    """Merge several solids."""
    first = np.cumsum([0, *(len(solid.vertices) for solid in solids[:-1])]).astype(np.uint32)
    return Solid(
        np.concatenate([solid.vertices for solid in solids]),
        np.concatenate([solid.faces + start for solid, start in zip(solids, first, strict=True)]),
    )


def reversed_(solid: Solid) -> Solid:
    """Return the solid with its surface turned inside out."""
    return Solid(solid.vertices, solid.faces[:, ::-1].copy())


def bar(lengths: tuple[float, float, float]) -> Solid:
    """Box about the origin."""
    square = np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]])
    two = np.array([[0, 1, 2], [0, 2, 3]])
    # Each pair of sides is the first with its axes in cyclic order; the far side is its image from behind.
    near = [np.roll(square, shift, axis=1) * np.array(lengths) / 2 for shift in range(3)]
    sides = [Solid(corners.astype(np.float32), two.astype(np.uint32)) for corners in near]
    far = [Solid(-side.vertices, side.faces[:, ::-1].copy()) for side in sides]
    return merged_solid([*sides, *far])


def _strip(circle: NDArray[np.float64], start: tuple[float, float], end: tuple[float, float]) -> Solid:
    """Return the surface that one segment of an outline sweeps, with its own vertices."""
    rings = [
        np.column_stack([radius * circle, np.full(len(circle), height)]) for radius, height in (start, end)
    ]
    return Solid(np.concatenate(rings).astype(np.float32), _grid(2, len(circle)))


def _grid(rows: int, columns: int) -> NDArray[np.uint32]:
    """Two triangles for each cell of a grid of vertices, rows upward and columns counter-clockwise."""
    corner = np.arange(rows * columns).reshape(rows, columns)
    a, b = corner[:-1, :-1].ravel(), corner[:-1, 1:].ravel()
    c, d = corner[1:, 1:].ravel(), corner[1:, :-1].ravel()
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]).astype(np.uint32)
