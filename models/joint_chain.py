"""General joint of the rotor: three hinges in series with any axes, and three bodies with any inertia.

The model of `lagrangian` is the ideal case: hinges along x, y, z through one point, rings without mass, and
a rotor whose centre of mass is that point. Here the axes may be tilted and apart, both gimbal rings have
inertia, and the rotor has an inertia tensor and a centre of mass anywhere.

Every vector is given in the stator frame S at the pose 0. Frame i is fixed to body i and equals S at the pose
0; hinge i turns it about the carried axis (product of exponentials). Each body is replaced by four point
masses with the same mass, centre of mass and inertia tensor (an equimomental system), at the vertices of a
tetrahedron that is stretched along the principal axes. With a point mass m at x and the derivative J_i of x
with respect to the angle i, ``M_ij = sum m J_i.J_j`` and the bias is ``sum m J_i.(a - g)``, where a is the
acceleration of the point at constant hinge rates. No tensor and no derivative of one is needed.
"""

from __future__ import annotations

from math import asin, atan2

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free, inlined
from spheretwin.models.base.record import Record, Rows, field, put
from spheretwin.models.kinematics import Triple, generalised_torque, triple, turns
from spheretwin.models.lagrangian import InertiaEntries, acceleration_entries, inertia_entries, solve_inertia
from spheretwin.models.mjcf import gravity

Triples = tuple[Triple, Triple, Triple]
Frame = tuple[Triple, Triple, Triple, Triple]  # axes x, y, z and origin

_ZERO: Triple = (0.0, 0.0, 0.0)
_STATOR: Frame = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), _ZERO
_TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
_ROUNDING = 1e-12  # of axes that a compiler normalises


class JointChain(Record):
    """Joint of a machine with the hinges alpha, beta, gamma."""

    on: bool = field("whether the equations of a general joint apply; 0: closed forms of an ideal one")
    is_tilted: bool = field("whether the hinges are not along x, y, z through the joint centre")
    inertia: Array = field("principal moments of an ideal joint, with the payload", "kg·m²", 3)
    weight_moment: float = field("weight of the payload times its height, of an ideal joint", "N·m")
    axes: Array = field("unit vectors along the hinges at the pose 0", "", (3, 3))
    points: Array = field("point of each axis", "m", (3, 3))
    masses: Array = field("x, y, z (m) and mass (kg) in outer ring, inner ring, rotor", "", (3, 4, 4))
    gravity: Array = field("gravity in the stator frame", "m/s²", 3)


def fill_ideal(joints: Rows, inertia: ArrayLike, weight_moment: ArrayLike = 0.0) -> None:
    """Fill joints with hinges along x, y, z through the centre of mass, and rings without mass.

    Parameters
    ----------
    joints : array of JointChain
    inertia : (3,) or (n, 3) array, kg·m²
        Principal moments about the joint centre, payload included.
    weight_moment : float or (n, 1) array, N·m
        Weight of the payload times its height.
    """
    put(joints, inertia=inertia, weight_moment=weight_moment, axes=np.eye(3))


def fill_chain(joints: Rows, model: mujoco.MjModel) -> None:
    """Fill joints with the hinges, masses and gravity of a compiled model with three hinges in series.

    Parameters
    ----------
    joints : array of JointChain
    model : MjModel
        Each moving body belongs to the last hinge before it.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mass, moment, second = np.zeros((3, 1)), np.zeros((3, 3)), np.zeros((3, 3, 3))
    for body, root in enumerate(model.body_weldid):
        if root:
            last = model.body_dofadr[root] + model.body_dofnum[root] - 1
            m, c, R = model.body_mass[body], data.xipos[body], data.ximat[body].reshape(3, 3)
            inertia = model.body_inertia[body]
            mass[last] += m
            moment[last] += m * c
            second[last] += m * np.outer(c, c) + R * (inertia.sum() / 2 - inertia) @ R.T
    masses = np.zeros((3, 4, 4))
    for last in np.flatnonzero(mass):
        centre = moment[last] / mass[last]
        squares, axes = np.linalg.eigh(second[last] / mass[last] - np.outer(centre, centre))
        masses[last, :, :3] = centre + _TETRAHEDRON * np.sqrt(np.maximum(squares, 0)) @ axes.T
        masses[last, :, 3] = mass[last] / 4
    is_ideal = np.allclose((data.xaxis, data.xanchor), (np.eye(3), np.zeros((3, 3))), 0, _ROUNDING)
    joints["on"], joints["is_tilted"] = 1, not is_ideal
    joints["axes"], joints["points"], joints["masses"] = data.xaxis, data.xanchor, masses
    joints["gravity"] = gravity(model.opt)


@inlined
def inertia_at(joint: JointChain, inertia: Triple, q: Triple) -> InertiaEntries:
    """Return the inertia matrix of a joint at a pose (rad).

    `inertia` (3,) has the principal moments of the ideal joint, kg·m².
    """
    return general_inertia(joint, q) if joint.on else inertia_entries(turns(q), inertia)


@inlined
def acceleration_at(
    joint: JointChain, inertia: Triple, weight_moment: float, q: Triple, qdot: Triple, torque: Triple
) -> Triple:
    """Return the hinge accelerations (rad/s²) of a joint.

    `inertia` and `weight_moment` are those of `acceleration`, for the ideal joint alone.
    """
    if joint.on:
        return general_acceleration(joint, q, qdot, torque)
    return acceleration_entries(turns(q), qdot, torque, inertia, weight_moment)


# Not inlined: a rotor with an ideal joint does not compile them into each place, nor executes them.
@allocation_free
def general_inertia(joint: JointChain, q: Triple) -> InertiaEntries:
    """Return the inertia matrix of a general joint at a pose (rad)."""
    return equations(joint, q, _ZERO)[0]


@allocation_free
def general_acceleration(joint: JointChain, q: Triple, qdot: Triple, torque: Triple) -> Triple:
    """Return the hinge accelerations (rad/s²) of a general joint."""
    M, bias = equations(joint, q, qdot)
    return solve_inertia(M, _less(torque, bias), True)


@inlined
def equations(joint: JointChain, q: Triple, qdot: Triple) -> tuple[InertiaEntries, Triple]:
    """Return the equations of motion of a general joint.

    Parameters
    ----------
    joint : JointChain
    q, qdot : (3,) tuples, rad and rad/s
        Pose and hinge rates.

    Returns
    -------
    InertiaEntries, (3,) tuple in N·m
        Inertia matrix, and the torque on the hinges that holds the rates: Coriolis, centrifugal and gravity
        torque. A positive entry requires a positive torque, as on the left side of (1).
    """
    frames, axes, points = chain_at(joint, q)
    aa = bb = cc = ab = ac = bc = bias_a = bias_b = bias_c = 0.0
    w, w_rate, a = _ZERO, _ZERO, _less(_ZERO, triple(joint.gravity))  # of the present body; at the origin
    for body in range(3):
        e, p = axes[body], points[body]
        at_hinge, own = _acceleration(w, w_rate, a, p), _scaled(e, qdot[body])
        w_rate, w = _sum(w_rate, _cross(w, own)), _sum(w, own)
        a = _less(at_hinge, _acceleration(w, w_rate, _ZERO, p))
        for k in range(4):
            y = joint.masses[body, k]
            m, x = y[3], _place(frames[body], (y[0], y[1], y[2]))
            force = _scaled(_acceleration(w, w_rate, a, x), m)
            J_a = _cross(axes[0], _less(x, points[0]))
            J_b = _cross(axes[1], _less(x, points[1])) if body > 0 else _ZERO
            J_c = _cross(axes[2], _less(x, points[2])) if body > 1 else _ZERO
            aa, bb, cc = aa + m * _dot(J_a, J_a), bb + m * _dot(J_b, J_b), cc + m * _dot(J_c, J_c)
            ab, ac, bc = ab + m * _dot(J_a, J_b), ac + m * _dot(J_a, J_c), bc + m * _dot(J_b, J_c)
            bias_a, bias_b = bias_a + _dot(J_a, force), bias_b + _dot(J_b, force)
            bias_c += _dot(J_c, force)
    return InertiaEntries(aa, bb, cc, ab, ac, bc), (bias_a, bias_b, bias_c)


@allocation_free
def hinge_torque(joint: JointChain, q: Array, torque_S: Array, torque_q: Array) -> None:
    """Compute the torque on each hinge of a torque on the rotor: its component along the axis.

    Parameters
    ----------
    joint : JointChain
    q : (3,) array, rad
        Pose.
    torque_S : (3,) array, N·m
        On the rotor, stator frame.
    torque_q : (3,) array, N·m
        Result, on (alpha, beta, gamma).
    """
    _, axes, _ = chain_at(joint, triple(q))
    for i in range(3):
        torque_q[i] = _dot(axes[i], triple(torque_S))


@allocation_free
def ideal_pose(joint: JointChain, q: Array, qdot: Array, ideal_q: Array, ideal_qdot: Array) -> None:
    """Compute the angles of ideal hinges with the orientation of a general joint, and their rates.

    Parameters
    ----------
    joint : JointChain
    q, qdot : (3,) arrays, rad and rad/s
        Pose and rates of the general joint.
    ideal_q, ideal_qdot : (3,) arrays, rad and rad/s
        Result: `rotation` of the first is the orientation of the rotor, `rate_jacobian` times the second its
        angular velocity. Singular at +-90 degrees of the second angle.
    """
    (_, _, (X, Y, Z, _)), (e_a, e_b, e_c), _ = chain_at(joint, triple(q))
    ideal_q[0], ideal_q[1], ideal_q[2] = atan2(-Z[1], Z[2]), asin(Z[0]), atan2(-Y[0], X[0])
    at = turns(triple(ideal_q))
    x, y, z = _sum(_scaled(e_a, qdot[0]), _sum(_scaled(e_b, qdot[1]), _scaled(e_c, qdot[2])))
    ideal_qdot[2] = (at.ca * z - at.sa * y) / at.cb
    ideal_qdot[1] = at.ca * y + at.sa * z
    ideal_qdot[0] = x - at.sb * ideal_qdot[2]


@inlined
def update_ideal_motion(joint: JointChain, q: Array, qdot: Array, ideal_q: Array, ideal_qdot: Array) -> None:
    """Compute `ideal_pose` of any joint."""
    if joint.is_tilted:
        ideal_pose(joint, q, qdot, ideal_q, ideal_qdot)
    else:
        for i in range(3):
            ideal_q[i], ideal_qdot[i] = q[i], qdot[i]


@inlined
def torque_on_hinges(joint: JointChain, q: Array, torque_S: Array, torque_q: Array) -> None:
    """Compute the torque on the hinges of a torque on the rotor, as `hinge_torque`, of any joint."""
    if joint.is_tilted:
        hinge_torque(joint, q, torque_S, torque_q)
    else:
        generalised_torque(q, torque_S, torque_q)


@inlined
def chain_at(joint: JointChain, q: Triple) -> tuple[tuple[Frame, Frame, Frame], Triples, Triples]:
    """Return frames of the bodies, axes of the hinges, and a point of each axis, at a pose (rad)."""
    at = turns(q)
    outer, e_a, p_a = _turned(joint, 0, _STATOR, at.ca, at.sa)
    inner, e_b, p_b = _turned(joint, 1, outer, at.cb, at.sb)
    rotor, e_c, p_c = _turned(joint, 2, inner, at.cg, at.sg)
    return (outer, inner, rotor), (e_a, e_b, e_c), (p_a, p_b, p_c)


@inlined
def _turned(joint: JointChain, hinge: int, frame: Frame, c: float, s: float) -> tuple[Frame, Triple, Triple]:
    """Return the frame after a hinge at an angle of cosine c and sine s, its axis and a point of the axis."""
    X, Y, Z, origin = frame
    p = _place(frame, joint.points[hinge])
    e = _less(_place(frame, joint.axes[hinge]), origin)
    x, y, z = _rotated(X, e, c, s), _rotated(Y, e, c, s), _rotated(Z, e, c, s)
    return (x, y, z, _sum(p, _rotated(_less(origin, p), e, c, s))), e, p


@inlined
def _rotated(v: Triple, e: Triple, c: float, s: float) -> Triple:
    """Rotate a vector about a unit vector by an angle with a given cosine and sine (Rodrigues)."""
    return _sum(_sum(_scaled(v, c), _scaled(_cross(e, v), s)), _scaled(e, (1.0 - c) * _dot(e, v)))


@inlined
def _acceleration(w: Triple, w_rate: Triple, a: Triple, x: Triple) -> Triple:
    """Return the acceleration at x of a body whose point at the origin has the acceleration a."""
    return _sum(a, _sum(_cross(w_rate, x), _cross(w, _cross(w, x))))


@inlined
def _place(frame: Frame, y: Triple) -> Triple:
    X, Y, Z, origin = frame
    return _sum(origin, _sum(_scaled(X, y[0]), _sum(_scaled(Y, y[1]), _scaled(Z, y[2]))))


@inlined
def _sum(a: Triple, b: Triple) -> Triple:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined
def _less(a: Triple, b: Triple) -> Triple:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined
def _scaled(a: Triple, factor: float) -> Triple:
    return factor * a[0], factor * a[1], factor * a[2]


@inlined
def _dot(a: Triple, b: Triple) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def _cross(a: Triple, b: Triple) -> Triple:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
