"""Static parts of the scene: axes, labels, colour scale and meshes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.chunk import Chunk

from spheretwin.models.actuator import Actuator
from spheretwin.viz import theme
from spheretwin.viz.rerun_internals import LogEncoder
from spheretwin.viz.scene.meshes import AXES, COILS, CURRENT_SCALE, PAYLOAD, ROTOR_AXES, WORLD, Meshes

Array = NDArray[np.float64]

AXES_LENGTH_m = 0.05
"""Length of the stator's axes: the unit of all lengths in the scene."""

REACH_m = 0.12
"""Reach from the joint of an actuator for which the lengths here are right."""

# A bar before the foot, square to the eye of the layout; its ends are the current limit.
MIDDLE_m = np.array([0.064, -0.064, -0.078])
ALONG = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
UP = np.array([-0.4, 0.4, 0.82])
LENGTH_m, HEIGHT_m = 0.14, 0.008
STRIPES = 32
TICKS = (-1.0, 0.0, 1.0)


def size_of(actuator: Actuator) -> float:
    """Return the size of an actuator relative to the one for which the lengths here are right."""
    coils_m = actuator.coil.distance_m + actuator.coil.length_m / 2
    return max(float(np.linalg.norm(actuator.shaft_tip_m)), coils_m) / REACH_m


def axes(origin_m: Sequence[float] | Array, length_m: float) -> rr.Arrows3D:
    """Axes of a frame in the colours of the plots."""
    return rr.Arrows3D(
        origins=[origin_m] * 3,
        vectors=length_m * np.eye(3),
        colors=theme.AXIS_COLOURS,
        radii=rr.Radius.ui_points(1.5),
    )


def labels(texts: Sequence[str], colours: Sequence[theme.Colour]) -> rr.Points3D:
    """Return texts for the heads of arrows, as points of size 0: an arrow's own text is at its middle."""
    size = rr.Radius.ui_points(0.0)
    return rr.Points3D.from_fields(labels=texts, colors=colours, radii=size, show_labels=True)


def current_scale(size: float) -> rr.Mesh3D:
    """Bar in the colours of all currents within the limit, for an actuator of a size."""
    share = np.linspace(-1.0, 1.0, STRIPES + 1)
    lower = MIDDLE_m + LENGTH_m / 2 * share[:, None] * ALONG
    first = np.arange(STRIPES)
    one, other = (
        [first, first + 1, first + STRIPES + 1],
        [first + 1, first + STRIPES + 2, first + STRIPES + 1],
    )
    return rr.Mesh3D(
        vertex_positions=size * np.concatenate([lower, lower + HEIGHT_m * UP]),
        triangle_indices=np.concatenate([np.stack(corners, axis=1) for corners in (one, other)]),
        vertex_colors=np.tile(theme.current_colours(share, 1.0), (2, 1)),
    )


def current_scale_labels(limit_A: float, size: float) -> rr.Points3D:
    """Currents along the bar."""
    at = np.array(TICKS)
    return rr.Points3D(
        size * (MIDDLE_m + LENGTH_m / 2 * at[:, None] * ALONG - 0.3 * HEIGHT_m * UP),
        labels=[f"{share * limit_A:+g} A" if share else "0" for share in at.tolist()],
        colors=theme.current_colours(at, 1.0),
        radii=rr.Radius.ui_points(1.0),
        show_labels=True,
    )


PAYLOAD_LENGTH_m, PAYLOAD_RADIUS_m = 0.014, 0.011

# The stator's axes are next to its foot; the rotor's, shorter, around the shaft below a payload.
AXES_AT_m = (-0.085, -0.105, -0.075)
NAMED_AT = 1.15  # of the length: beyond the head
ROTOR_AXES_HEIGHT, ROTOR_AXES_LENGTH_m = 0.6, 0.025


@lru_cache(maxsize=4)
def static_scene(meshes: Meshes, actuator: Actuator, current_limit_A: float, payload: bool) -> list[Chunk]:
    """Return the static parts, encoded: meshes, axes of both frames, the scale of the coils' colours."""
    recording = LogEncoder()
    recording.log(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    if meshes.coils:
        recording.log(COILS, meshes.coils, coil_texture(meshes, actuator), static=True)
    for entity, piece in meshes.others.items():
        recording.log(entity, *piece.archetypes(), static=True)
    if payload:
        recording.log(PAYLOAD, _payload(actuator), static=True)
    size = size_of(actuator)
    at, length_m = size * np.array(AXES_AT_m), size * AXES_LENGTH_m
    names = labels(["x", "y", "z"], theme.AXIS_COLOURS)
    ends = rr.Points3D.from_fields(positions=at + NAMED_AT * length_m * np.eye(3))
    recording.log(AXES, axes(at, length_m), names, ends, static=True)
    rotor_axes = axes(ROTOR_AXES_HEIGHT * actuator.shaft_tip_m, size * ROTOR_AXES_LENGTH_m)
    recording.log(ROTOR_AXES, rotor_axes, static=True)
    recording.log(CURRENT_SCALE, current_scale(size), static=True)
    currents = current_scale_labels(current_limit_A, size)
    recording.log(f"{CURRENT_SCALE}/labels", currents, static=True)
    return list(recording.chunks().values())


def coil_texture(meshes: Meshes, actuator: Actuator) -> rr.Mesh3D:
    """Return the texture of the coils: a pixel for each group, whose coils carry one current."""
    groups = len(actuator.groups)
    group = np.empty(actuator.groups.size)
    group[actuator.groups] = np.arange(groups)[:, None]
    assert meshes.coils is not None
    positions = meshes.coils.vertex_positions
    assert positions is not None
    vertices = len(positions.as_arrow_array()) // len(meshes.coil_places)
    across = np.repeat((group[list(meshes.coil_places)] + 0.5) / groups, vertices)
    return rr.Mesh3D.from_fields(
        vertex_texcoords=np.stack([across, np.full_like(across, 0.5)], axis=1),
        albedo_texture_format=rr.components.ImageFormat(
            width=groups, height=1, color_model="RGB", channel_datatype="U8"
        ),
    )


def _payload(actuator: Actuator) -> rr.Cylinders3D:
    return rr.Cylinders3D(
        lengths=[PAYLOAD_LENGTH_m],
        radii=[PAYLOAD_RADIUS_m],
        centers=[actuator.payload_mount_m],
        colors=[theme.PAYLOAD],
        fill_mode=rr.components.FillMode.Solid,
    )
