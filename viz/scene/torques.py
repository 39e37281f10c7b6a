"""The torques on the rotor as arrows in the stator frame."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.viz import palette
from spheretwin.viz.scene.marks import AXES_LENGTH_m
from spheretwin.viz.scene.poses import carried

Array = NDArray[np.float64]


class Shown(NamedTuple):
    """How a torque is shown."""

    label: str
    colour: palette.Colour


SHOWN = {
    "coils": Shown("coils", palette.COIL_TORQUE),
    "gravity": Shown("gravity", palette.PAYLOAD),
    "load": Shown("load", palette.LOAD),
}
"""By name."""

METRES_PER_Nm = 0.1
"""Beside an actuator as large as the shipped one; like the axes, longer beside a larger one."""

SCALE = f"torque arrows: the length of x, y, z is {AXES_LENGTH_m / METRES_PER_Nm:g} N·m"
"""What the arrows' lengths mean, for people."""

LONGEST_m = 1e3
"""Of an arrow along each axis: torques of a run that diverges are beyond single precision."""


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
        Where it is, rotor frame.
    gravity_m_s2 : (3,) array, m/s²
        Stator frame.

    Returns
    -------
    (n, 3) array, N·m
        On the rotor, stator frame.
    """
    return np.cross(carried(q, mount_m), payload_kg * gravity_m_s2)
