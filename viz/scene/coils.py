"""The actuator's coils, turned from their numbers: drawn alike in every recording, and in few bytes."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.actuator import Coil
from spheretwin.viz.scene.solids import joined, turned

# What a coil looks like beside its numbers: a winding between two flanges.
SECTIONS = 14
FLANGE_SHARE = 0.07  # of the length
RECESS_SHARE = 0.12  # of the winding's depth

Array = NDArray[np.float64]


def coil_mesh(coil: Coil, centres: Array, axes: Array, places: list[int], count: int) -> rr.Mesh3D:
    """All coils as one mesh; each looks up its own pixel of a texture, whose bytes then change over time.

    Of the ways to colour dozens of coils at 60 Hz this is the cheapest that keeps their shape: a mesh entity
    for each costs the viewer three times as long a frame.

    Parameters
    ----------
    coil : Coil
        Its radii and its length.
    centres : (n, 3) array, m
        Where coils are drawn.
    axes : (n, 3) array
        Unit vectors along them.
    places : list of int
        Each one's place among the actuator's coils.
    count : int
        How many the actuator has.
    """
    one = turned(_outline(coil), SECTIONS)
    drawn = [one.placed(_turned_to(axis), centre) for axis, centre in zip(axes, centres, strict=True)]
    pixel = np.repeat((np.array(places) + 0.5) / count, len(one.positions))
    whole = joined(drawn)
    return rr.Mesh3D.from_fields(
        vertex_positions=whole.positions,
        vertex_normals=whole.normals,
        triangle_indices=whole.triangles,
        vertex_texcoords=np.stack([pixel, np.full_like(pixel, 0.5)], axis=1),
        albedo_texture_format=rr.components.ImageFormat(
            width=count, height=1, color_model="RGB", channel_datatype="U8"
        ),
    )


def _outline(coil: Coil) -> list[tuple[float, float]]:
    """Corners of a coil's outline, each distance from the axis and height along it, m."""
    bore, radius, half = coil.inner_radius_m, coil.outer_radius_m, coil.length_m / 2
    flange = FLANGE_SHARE * coil.length_m
    winding, edge = radius - RECESS_SHARE * (radius - bore), half - flange
    above = [(winding, edge), (radius, edge), (radius, half), (bore, half)]
    below = [(distance, -height) for distance, height in reversed(above)]
    return [*below, *above, below[0]]


def _turned_to(axis: Array) -> Array:
    """A rotation that takes z to a unit vector: its columns."""
    aside = np.eye(3)[np.argmin(np.abs(axis))]
    x = np.cross(aside, axis)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)
