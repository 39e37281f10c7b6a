"""Triangles with normals: what a drawn solid is made of, how it is turned, moved and joined."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Drawn:
    """A mesh with one normal a vertex."""

    positions: NDArray[np.float32]  # (n, 3) m
    normals: NDArray[np.float32]  # (n, 3)
    triangles: NDArray[np.int64]  # (m, 3), counter-clockwise from outside

    def placed(self, rotation: Array, translation: Array) -> Drawn:
        """The same, turned and then moved."""
        positions = self.positions @ rotation.T + translation
        normals = self.normals @ rotation.T
        return Drawn(positions.astype(np.float32), normals.astype(np.float32), self.triangles)


def joined(drawn: list[Drawn]) -> Drawn:
    """Several as one, in their order."""
    first = np.cumsum([0] + [len(part.positions) for part in drawn[:-1]])
    return Drawn(
        np.concatenate([part.positions for part in drawn]),
        np.concatenate([part.normals for part in drawn]),
        np.concatenate([part.triangles + start for part, start in zip(drawn, first, strict=True)]),
    )


def turned(outline: list[tuple[float, float]], sections: int) -> Drawn:
    """Solid of revolution about z, with an edge at each corner of its outline.

    Parameters
    ----------
    outline : list of (float, float), m
        Corners, distance from z and height, the solid on their left.
    sections : int
        Of a circle.
    """
    corners = np.array(outline)
    return joined([_band(*ends, sections) for ends in pairwise(corners)])


def _band(first: Array, last: Array, sections: int) -> Drawn:
    """What a stretch between two corners sweeps."""
    angle = 2 * np.pi * np.arange(sections) / sections
    along = (last - first) / np.linalg.norm(last - first)
    outward = _circle(np.array([along[1], -along[0]]), angle)
    here = np.arange(sections)
    there = np.roll(here, -1)
    lower = np.stack([here, there, there + sections], axis=1)
    upper = np.stack([here, there + sections, here + sections], axis=1)
    return Drawn(
        np.concatenate([_circle(first, angle), _circle(last, angle)]),
        np.concatenate([outward, outward]),
        np.concatenate([lower, upper]),
    )


def _circle(point: Array, angle: Array) -> NDArray[np.float32]:
    """A point (distance from z, height) carried around z: (angles, 3)."""
    distance, height = point
    around = [distance * np.cos(angle), distance * np.sin(angle), height + 0 * angle]
    return np.stack(around, axis=1).astype(np.float32)
