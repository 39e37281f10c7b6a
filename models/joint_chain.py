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
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import inlined
from spheretwin.models.kinematics import Triple, generalised_torque, triple, turns
from spheretwin.models.lagrangian import InertiaEntries, acceleration_entries, inertia_entries, solve_inertia
from spheretwin.models.mjcf import gravity

Array = NDArray[np.float64]
Rows = tuple[Triple, Triple, Triple]
Frame = tuple[Triple, Triple, Triple, Triple]  # axes x, y, z and origin

_ZERO: Triple = (0.0, 0.0, 0.0)
_STATOR: Frame = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), _ZERO
_TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
_ROUNDING = 1e-12  # of axes that a compiler normalises


class JointChain(NamedTuple):
    """Joint of a machine with the hinges alpha, beta, gamma."""

    axes: Rows  # unit vectors along the hinges at the pose 0
    points: Rows  # m, a point of each axis
    masses: Array  # (3, 4, 4) of outer ring, inner ring, rotor with payload: x, y, z in m, mass in kg
    gravity: Triple  # m/s², stator frame

    @property
    def has_ideal_hinges(self) -> bool:
        """True if the hinges are along x, y, z through the joint centre."""
        return np.allclose((*self.axes, *self.points), (*np.eye(3), *np.zeros((3, 3))), 0, _ROUNDING)


def read_chain(model: mujoco.MjModel) -> JointChain:
    """Read the joint of a compiled model with three hinges in series.

    Parameters
    ----------
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
    hinges: Any = [tuple(map(tuple, vectors.tolist())) for vectors in (data.xaxis, data.xanchor)]
    return JointChain(hinges[0], hinges[1], masses, gravity(model.opt))


@inlined
def inertia_at(chain: JointChain | None, inertia: Array, q: Triple) -> InertiaEntries:
    """Return the inertia matrix at a pose (rad) of a general joint or, if chain is None, an ideal one.

    `inertia` (3,) has the principal moments of the ideal joint, kg·m².
    """
    # Numba omits the branch that the type of an argument excludes.
    if chain is None:
        return inertia_entries(turns(q), triple(inertia))
    return equations(chain, q, _ZERO)[0]


@inlined
def acceleration_at(
    chain: JointChain | None, inertia: Array, weight_moment: float, q: Triple, qdot: Triple, torque: Triple
) -> Triple:
    """Return the hinge accelerations (rad/s²) of a general joint or, if chain is None, an ideal one.

    `inertia` and `weight_moment` are those of `acceleration`, for the ideal joint alone.
    """
    if chain is None:
        return acceleration_entries(turns(q), qdot, torque, triple(inertia), weight_moment)
    M, bias = equations(chain, q, qdot)
    return solve_inertia(M, _less(torque, bias), chain)


@inlined
def equations(chain: JointChain, q: Triple, qdot: Triple) -> tuple[InertiaEntries, Triple]:
    """Return the equations of motion of a general joint.

    Parameters
    ----------
    chain : JointChain
    q, qdot : (3,) tuples, rad and rad/s
        Pose and hinge rates.

    Returns
    -------
    InertiaEntries, (3,) tuple in N·m
        Inertia matrix, and the torque on the hinges that holds the rates: Coriolis, centrifugal and gravity
        torque. A positive entry requires a positive torque, as on the left side of (1).
    """
    frames, axes, points = chain_at(chain, q)
    aa = bb = cc = ab = ac = bc = bias_a = bias_b = bias_c = 0.0
    w, w_rate, a = _ZERO, _ZERO, _less(_ZERO, chain.gravity)  # of the present body; at the origin of S
    for body in range(3):
        e, p = axes[body], points[body]
        at_hinge, own = _acceleration(w, w_rate, a, p), _scaled(e, qdot[body])
        w_rate, w = _sum(w_rate, _cross(w, own)), _sum(w, own)
        a = _less(at_hinge, _acceleration(w, w_rate, _ZERO, p))
        for k in range(4):
            y = chain.masses[body, k]
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


@inlined
def hinge_torque(chain: JointChain, q: Array, torque_S: Array, torque_q: Array) -> None:
    """Compute the torque on each hinge of a torque on the rotor: its component along the axis.

    Parameters
    ----------
    chain : JointChain
    q : (3,) array, rad
        Pose.
    torque_S : (3,) array, N·m
        On the rotor, stator frame.
    torque_q : (3,) array, N·m
        Result, on (alpha, beta, gamma).
    """
    _, axes, _ = chain_at(chain, triple(q))
    for i in range(3):
        torque_q[i] = _dot(axes[i], triple(torque_S))


@inlined
def ideal_pose(chain: JointChain, q: Array, qdot: Array, ideal_q: Array, ideal_qdot: Array) -> None:
    """Compute the angles of ideal hinges with the orientation of a general joint, and their rates.

    Parameters
    ----------
    chain : JointChain
    q, qdot : (3,) arrays, rad and rad/s
        Pose and rates of the general joint.
    ideal_q, ideal_qdot : (3,) arrays, rad and rad/s
        Result: `rotation` of the first is the orientation of the rotor, `rate_jacobian` times the second its
        angular velocity. Singular at +-90 degrees of the second angle.
    """
    (_, _, (X, Y, Z, _)), (e_a, e_b, e_c), _ = chain_at(chain, triple(q))
    ideal_q[0], ideal_q[1], ideal_q[2] = atan2(-Z[1], Z[2]), asin(Z[0]), atan2(-Y[0], X[0])
    at = turns(triple(ideal_q))
    x, y, z = _sum(_scaled(e_a, qdot[0]), _sum(_scaled(e_b, qdot[1]), _scaled(e_c, qdot[2])))
    ideal_qdot[2] = (at.ca * z - at.sa * y) / at.cb
    ideal_qdot[1] = at.ca * y + at.sa * z
    ideal_qdot[0] = x - at.sb * ideal_qdot[2]


@inlined
def update_ideal_motion(
    chain: JointChain | None, q: Array, qdot: Array, ideal_q: Array, ideal_qdot: Array
) -> None:
    """Compute `ideal_pose` of a general joint; the results stay as they are if chain is None."""
    if chain is not None:
        ideal_pose(chain, q, qdot, ideal_q, ideal_qdot)


@inlined
def torque_on_hinges(chain: JointChain | None, q: Array, torque_S: Array, torque_q: Array) -> None:
    """Compute the torque on the hinges of a torque on the rotor, as `hinge_torque`, of any joint."""
    if chain is None:
        generalised_torque(q, torque_S, torque_q)
    else:
        hinge_torque(chain, q, torque_S, torque_q)


@inlined
def chain_at(chain: JointChain, q: Triple) -> tuple[tuple[Frame, Frame, Frame], Rows, Rows]:
    """Return frames of the bodies, axes of the hinges, and a point of each axis, at a pose (rad)."""
    at = turns(q)
    outer, e_a, p_a = _turned(chain, 0, _STATOR, at.ca, at.sa)
    inner, e_b, p_b = _turned(chain, 1, outer, at.cb, at.sb)
    rotor, e_c, p_c = _turned(chain, 2, inner, at.cg, at.sg)
    return (outer, inner, rotor), (e_a, e_b, e_c), (p_a, p_b, p_c)


@inlined
def _turned(chain: JointChain, hinge: int, frame: Frame, c: float, s: float) -> tuple[Frame, Triple, Triple]:
    """Return the frame after a hinge at an angle of cosine c and sine s, its axis and a point of the axis."""
    X, Y, Z, origin = frame
    p = _place(frame, chain.points[hinge])
    e = _less(_place(frame, chain.axes[hinge]), origin)
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
