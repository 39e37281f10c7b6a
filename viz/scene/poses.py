"""Where the moving parts of the actuator are, from its hinge angles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator


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
    return carried(q, actuator.shaft_tip_m)


def carried(q: NDArray[np.float64], point_m: NDArray[np.float64]) -> NDArray[np.float64]:
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
