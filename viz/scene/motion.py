"""Motion of the actuator's parts as a function of the hinge angles, torque arrows and traces."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.viz import theme
from spheretwin.viz.scene.meshes import WORLD
from spheretwin.viz.scene.static import AXES_LENGTH_m

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


def shaft_tip(q: NDArray[np.float64], actuator: Actuator) -> NDArray[np.float64]:
    """Position of the shaft's tip, wherever in the rotor it is: (n, 3) in m, for hinge angles (n, 3)."""
    return point_in_stator(q, actuator.shaft_tip_m)


def point_in_stator(q: NDArray[np.float64], point_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Position in the stator frame of a point of the rotor: (n, 3) in m, for hinge angles (n, 3)."""
    (ca, cb, cg), (sa, sb, sg) = np.cos(q).T, np.sin(q).T
    x, y, z = point_m
    x, y = cg * x - sg * y, sg * x + cg * y  # about z, then y, then x
    x, z = cb * x + sb * z, cb * z - sb * x
    y, z = ca * y - sa * z, sa * y + ca * z
    return np.stack([x, y, z], axis=1)


def _about(axis: int, angle: NDArray[np.float64]) -> NDArray[np.float64]:
    quaternion = np.zeros((len(angle), 4))
    quaternion[:, axis], quaternion[:, 3] = np.sin(angle / 2), np.cos(angle / 2)
    return quaternion


def _product(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quaternion product: first b, then a."""
    vector = a[:, 3:] * b[:, :3] + b[:, 3:] * a[:, :3] + np.cross(a[:, :3], b[:, :3])
    scalar = a[:, 3] * b[:, 3] - np.sum(a[:, :3] * b[:, :3], axis=1)
    return np.concatenate([vector, scalar[:, None]], axis=1)


Array = NDArray[np.float64]


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
