"""Entities of the scene: axes, labels, colour scale and meshes; moving parts, torque arrows and traces."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.chunk import Chunk

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.viz import theme
from spheretwin.viz.rerun_internals import LogEncoder
from spheretwin.viz.scene.meshes import (
    AXES,
    COILS,
    CURRENT_SCALE,
    PAYLOAD,
    ROTOR_AXES,
    WORLD,
    Meshes,
)
from spheretwin.viz.scene.places import point_in_stator

AXES_LENGTH_m = 0.05
"""Length of the stator's axes: the unit of all lengths in the scene."""

REACH_m = 0.12
"""Reach from the joint of an actuator for which the lengths here are right."""

# A bar before the foot, square to the eye of the layout.
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
    readable = [theme.label_colour(colour) for colour in colours]
    return rr.Points3D.from_fields(labels=texts, colors=readable, radii=size, show_labels=True)


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


def current_scale_places(size: float) -> rr.Points3D:
    """Places of the labels of the bar."""
    at = np.array(TICKS)
    places = size * (MIDDLE_m + LENGTH_m / 2 * at[:, None] * ALONG - 0.3 * HEIGHT_m * UP)
    return rr.Points3D(places, radii=rr.Radius.ui_points(1.0), show_labels=True)


def current_scale_labels(range_A: float, limit_A: float) -> rr.Points3D:
    """Currents along the bar, whose ends are a range within the current limit."""
    zero = "0" if range_A == limit_A else f"0, limit {limit_A:g} A"
    suffix = " (limit)" if range_A == limit_A else ""
    texts = [f"{share * range_A:+g} A{suffix}" if share else zero for share in TICKS]
    red_green_blue = theme.current_colours(np.array(TICKS), 1.0).tolist()
    return rr.Points3D.from_fields(labels=texts, colors=[theme.label_colour(of) for of in red_green_blue])


PAYLOAD_LENGTH_m, PAYLOAD_RADIUS_m = 0.014, 0.011

# The stator's axes are next to its foot; the rotor's, shorter, around the shaft below a payload.
AXES_AT_m = (-0.085, -0.105, -0.075)
NAMED_AT = 1.15  # of the length: beyond the head
ROTOR_AXES_HEIGHT, ROTOR_AXES_LENGTH_m = 0.6, 0.025


@lru_cache(maxsize=4)
def static_scene(meshes: Meshes, actuator: Actuator, payload: bool) -> list[Chunk]:
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
    recording.log(CURRENT_SCALE, current_scale(size), current_scale_places(size), static=True)
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


FRAME_RATE_Hz = 60.0
"""Rate of the poses of a recording."""


def body_quaternions(q: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Orientation of each moving body, as (n, 4) quaternions x, y, z, w.

    Parameters
    ----------
    q : (n, 3) array, rad
        Hinge angles.
    """
    about_x, about_y, about_z = (_about(axis, q[:, axis]) for axis in range(3))
    inner = _product(about_x, about_y)
    return {"outer_ring": about_x, "inner_ring": inner, "rotor": _product(inner, about_z)}


def _about(axis: int, angle: NDArray[np.float64]) -> NDArray[np.float64]:
    quaternion = np.zeros((len(angle), 4))
    quaternion[:, axis], quaternion[:, 3] = np.sin(angle / 2), np.cos(angle / 2)
    return quaternion


def _product(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quaternion product: first b, then a."""
    vector = a[:, 3:] * b[:, :3] + b[:, 3:] * a[:, :3] + np.cross(a[:, :3], b[:, :3])
    scalar = a[:, 3] * b[:, 3] - np.sum(a[:, :3] * b[:, :3], axis=1)
    return np.concatenate([vector, scalar[:, None]], axis=1)


class TorqueStyle(NamedTuple):
    """Label and colour of a torque."""

    label: str
    colour: theme.Colour


TORQUE_STYLES = {
    "coils": TorqueStyle("coils", theme.COIL_TORQUE),
    "gravity": TorqueStyle("gravity", theme.PAYLOAD),
    "load": TorqueStyle("load", theme.LOAD),
}
"""Styles by the name of the torque."""

METRES_PER_Nm = 0.1
"""Length of an arrow for an actuator of the shipped size; like the axes, it grows with the actuator."""

SCALE = f"axes are {AXES_LENGTH_m / METRES_PER_Nm:g} N·m long"
"""Scale of the arrows, for the name of the view."""

LONGEST_m = 1e3
"""Largest component of an arrow: torques of a run that diverges are beyond single precision."""


def load_torque(q: Array, disturbance_Nm: Array) -> Array:
    """Cartesian torque of the load: its part in (1) is subtracted, and ``tau_q = E^T tau``.

    Parameters
    ----------
    q : (n, 3) array, rad
        Poses, away from beta = +-90 degrees.
    disturbance_Nm : (n, 3) array
        Generalised, as the telemetry has it.

    Returns
    -------
    (n, 3) array, N·m
        On the rotor, stator frame.
    """
    (ca, cb, _), (sa, sb, _) = np.cos(q).T, np.sin(q).T
    about_alpha, about_beta, about_gamma = -disturbance_Nm.T
    in_plane = (about_gamma - sb * about_alpha) / cb
    return np.stack([about_alpha, ca * about_beta - sa * in_plane, sa * about_beta + ca * in_plane], axis=1)


def gravity_torque(q: Array, payload_kg: float, mount_m: Array, gravity_m_s2: Array) -> Array:
    """Torque of a payload's weight about the joint centre: ``r x m g``.

    Parameters
    ----------
    q : (n, 3) array, rad
        Poses.
    payload_kg : float, kg
        Point mass.
    mount_m : (3,) array, m
        Its position, rotor frame.
    gravity_m_s2 : (3,) array, m/s²
        Stator frame.

    Returns
    -------
    (n, 3) array, N·m
        On the rotor, stator frame.
    """
    return np.cross(point_in_stator(q, mount_m), payload_kg * gravity_m_s2)


TRAIL_S = 2.0
"""Older parts are not shown."""


class TipTrace(NamedTuple):
    """Part of a way, between two ages."""

    entity: str
    signal: str
    """Hinge angles, rad."""
    newest_s: float
    oldest_s: float
    rate_Hz: float
    colour: theme.Colour
    width: float
    """Radius in points of the screen."""


_FADED = [theme.mixed(theme.TRACE, theme.DESIRED_TRACE, share) for share in (0.0, 0.4, 0.75)]

TRACES: tuple[TipTrace, ...] = (
    TipTrace(f"{WORLD}/tip/new", "q_rad", 0.0, 0.6, 30.0, _FADED[0], 2.4),
    TipTrace(f"{WORLD}/tip/older", "q_rad", 0.6, 1.2, 15.0, _FADED[1], 1.7),
    TipTrace(f"{WORLD}/tip/oldest", "q_rad", 1.2, TRAIL_S, 15.0, _FADED[2], 1.2),
    TipTrace(f"{WORLD}/tip_desired", "q_ref_rad", 0.0, TRAIL_S, 15.0, theme.DESIRED_TRACE, 0.7),
)
"""Older parts are thinner and greyer, which is fainter on any ground; each age has its own segments."""
