"""Kinematics of the rotor on its three serial hinges.

The pose is ``q = [alpha, beta, gamma]``: intrinsic rotations about x, y, z. Frame S is the stator,
frame R the rotor; ``R_SR`` maps rotor-frame vectors into the stator frame.
"""

from math import cos, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import compiled, inlined
from spheretwin.models.base.trigonometry import LARGEST_rad, sine_cosine
from spheretwin.models.base.vectors import entry, vector

Triple = tuple[float, float, float]
"""An entry for each of alpha, beta, gamma."""

Row = tuple[float, float, float]


class Turns(NamedTuple):
    """Cosines and sines of a pose, the only terms of it in rotations and in the equations of motion."""

    ca: float
    sa: float
    cb: float
    sb: float
    cg: float
    sg: float


@compiled
def rotation(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation matrix ``R_SR = Rx(alpha) Ry(beta) Rz(gamma)``.

    Parameters
    ----------
    q : (3,) array, rad
        Pose.

    Returns
    -------
    (3, 3) array
        Maps rotor-frame vectors into the stator frame.

    Notes
    -----
    Paper section 2.1; its entry (3, 1) is misprinted and corrected here.
    """
    R_SR = np.empty((3, 3))
    for i, row in enumerate(rotation_rows(q)):
        R_SR[i, 0], R_SR[i, 1], R_SR[i, 2] = row
    return R_SR


@inlined
def rotation_rows(q: NDArray[np.float64]) -> tuple[Row, Row, Row]:
    """Return the rows of `rotation` as tuples: an array would take a third of the time of a torque matrix."""
    at = turns(triple(q))
    ca, sa, cb, sb, cg, sg = at.ca, at.sa, at.cb, at.sb, at.cg, at.sg
    first = (cb * cg, -cb * sg, sb)
    second = (ca * sg + sa * sb * cg, ca * cg - sa * sb * sg, -sa * cb)
    third = (sa * sg - ca * sb * cg, sa * cg + ca * sb * sg, ca * cb)
    return first, second, third


@compiled
def rate_jacobian(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rate Jacobian E: stator-frame angular velocity ``w_SR_S = E(q) qdot``.

    Parameters
    ----------
    q : (3,) array, rad
        Pose.

    Returns
    -------
    (3, 3) array
        E; its columns are the three hinge axes in the stator frame. Singular at beta = +-90 degrees.
    """
    at = turns(triple(q))
    ca, sa, cb, sb = at.ca, at.sa, at.cb, at.sb
    E = np.zeros((3, 3))
    E[0, 0], E[0, 2] = 1.0, sb
    E[1, 1], E[1, 2] = ca, -sa * cb
    E[2, 1], E[2, 2] = sa, ca * cb
    return E


@compiled
def rotor_rate_jacobian(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rate Jacobian B: rotor-frame angular velocity ``w_SR_R = B(q) qdot``.

    Parameters
    ----------
    q : (3,) array, rad
        Pose.

    Returns
    -------
    (3, 3) array
        B, equal to ``R_SR.T @ E``.
    """
    at = turns(triple(q))
    cb, sb, cg, sg = at.cb, at.sb, at.cg, at.sg
    B = np.zeros((3, 3))
    B[0, 0], B[0, 1] = cb * cg, sg
    B[1, 0], B[1, 1] = -cb * sg, cg
    B[2, 0], B[2, 2] = sb, 1.0
    return B


@inlined
def cartesian_torque(
    q: NDArray[np.float64], torque_q: NDArray[np.float64], torque_S: NDArray[np.float64]
) -> None:
    """Compute the Cartesian torque of a generalised torque: ``torque_S = E^-T torque_q``.

    The paper equates the two; they differ wherever the rotor is tilted, because virtual power gives
    ``torque_q = E^T torque_S``.

    Parameters
    ----------
    q : (3,) array, rad
        Pose, away from beta = +-90 degrees.
    torque_q : (3,) array, N·m
        Generalised torque on (alpha, beta, gamma).
    torque_S : (3,) array, N·m
        Result, in the stator frame.
    """
    at = turns(triple(q))
    ca, sa, cb, sb = at.ca, at.sa, at.cb, at.sb
    # Along the direction of the gamma hinge within the plane normal to the alpha hinge.
    in_plane = (torque_q[2] - sb * torque_q[0]) / cb
    torque_S[0] = torque_q[0]
    torque_S[1] = ca * torque_q[1] - sa * in_plane
    torque_S[2] = sa * torque_q[1] + ca * in_plane


@inlined
def generalised_torque(
    q: NDArray[np.float64], torque_S: NDArray[np.float64], torque_q: NDArray[np.float64]
) -> None:
    """Compute the generalised torque of a Cartesian torque: ``torque_q = E^T torque_S``.

    Parameters
    ----------
    q : (3,) array, rad
        Pose.
    torque_S : (3,) array, N·m
        On the rotor, stator frame.
    torque_q : (3,) array, N·m
        Result, on (alpha, beta, gamma).
    """
    at = turns(triple(q))
    ca, sa, cb, sb = at.ca, at.sa, at.cb, at.sb
    torque_q[0] = torque_S[0]
    torque_q[1] = ca * torque_S[1] + sa * torque_S[2]
    torque_q[2] = sb * torque_S[0] + cb * (ca * torque_S[2] - sa * torque_S[1])


@inlined
def angular_velocity(q: NDArray[np.float64], qdot: NDArray[np.float64], rate_S: NDArray[np.float64]) -> None:
    """Compute the angular velocity of the rotor in the stator frame: ``w_SR_S = E(q) qdot``.

    Parameters
    ----------
    q, qdot : (3,) arrays, rad and rad/s
        Pose and hinge rates.
    rate_S : (3,) array, rad/s
        Result.
    """
    at = turns(triple(q))
    ca, sa, cb, sb = at.ca, at.sa, at.cb, at.sb
    rate_S[0] = qdot[0] + sb * qdot[2]
    rate_S[1] = ca * qdot[1] - sa * cb * qdot[2]
    rate_S[2] = sa * qdot[1] + ca * cb * qdot[2]


AT_POLE_rad = 1e-6
"""Rotations from degrees have errors of 1e-15, which are no direction."""


def frame_of_axis(axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a rotation matrix (3, 3) whose columns point east and north of a unit axis, and along it.

    East is ``z x axis``. An axis within `AT_POLE_rad` of z has no east: its first column is y, as on the
    meridian of x.
    """
    x, y, _ = axis
    across = np.hypot(x, y)
    east = np.array([-y, x, 0.0]) / across if across > AT_POLE_rad else np.array([0.0, 1.0, 0.0])
    north = np.cross(axis, east)
    north /= np.linalg.norm(north)
    return np.column_stack([np.cross(north, axis), north, axis])


@inlined
def triple(values: NDArray[np.float64]) -> Triple:
    """Return the entries of a (3,) array."""
    return values[0], values[1], values[2]


@inlined
def turns(q: Triple) -> Turns:
    """Return the cosines and sines of a pose (rad).

    Calls of the library would take a fifth of the time of a control tick.
    """
    if abs(q[0]) <= LARGEST_rad and abs(q[1]) <= LARGEST_rad and abs(q[2]) <= LARGEST_rad:
        s, c = sine_cosine(vector(q[0], q[1], q[2], 0.0))
        return Turns(entry(c, 0), entry(s, 0), entry(c, 1), entry(s, 1), entry(c, 2), entry(s, 2))
    return Turns(cos(q[0]), sin(q[0]), cos(q[1]), sin(q[1]), cos(q[2]), sin(q[2]))
