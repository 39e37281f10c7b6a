"""Equations of motion and torque matrix as CasADi functions."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.extras import missing
from spheretwin.models.magnetics import KNEE, NARROW_PER_UNIT, WIDE_PER_UNIT
from spheretwin.plant.plant_step import Parameters

Array = NDArray[np.float64]

NAMES = (
    *(f"inertia_{axis}_kg_m2" for axis in "xyz"),
    "weight_moment_Nm",
    *(f"viscous_{hinge}_Nm_s" for hinge in ("alpha", "beta", "gamma")),
    *(f"coulomb_{hinge}_Nm" for hinge in ("alpha", "beta", "gamma")),
    *(f"spring_{hinge}_Nm_rad" for hinge in ("alpha", "beta", "gamma")),
    *(f"disturbance_{hinge}_Nm" for hinge in ("alpha", "beta", "gamma")),
)
"""Entries of p; a disturbance is subtracted, as in (1)."""


def library() -> Any:
    """Return the package casadi.

    Raises
    ------
    InputError
        It is not installed.
    """
    try:
        return import_module("casadi")
    except ImportError:
        raise missing("casadi", "casadi", "casadi") from None


def parameter_vector(parameters: Parameters) -> Array:
    """Return the vector p of `dynamics` with the values of a plant; its entries are `NAMES`.

    Raises
    ------
    InputError
        The plant has a general joint.
    """
    _check(parameters)
    return np.concatenate(
        [
            parameters.inertia_kg_m2,
            [parameters.weight_moment_Nm],
            parameters.viscous_Nm_s,
            parameters.coulomb_Nm,
            parameters.spring_Nm_rad,
            parameters.constant_torque_Nm,
        ]
    )


def dynamics(parameters: Parameters) -> Any:
    """Return the equations of motion under group currents.

    Parameters
    ----------
    parameters : plant.Parameters
        Of a plant with an ideal joint. Its magnetics and the smoothing of its friction are constants of the
        function; everything else is an argument, see `parameter_vector`.

    Returns
    -------
    casadi.Function
        ``f(x, u, p) -> xdot``: x and xdot (6,) of angles (rad) and rates, u (n,) currents in A, p (16,).

    Raises
    ------
    InputError
        The plant has a general joint, or casadi is not installed.
    """
    ca = library()
    _check(parameters)
    groups = len(parameters.torque_gain)
    x, u, p = ca.MX.sym("x", 6), ca.MX.sym("u", groups), ca.MX.sym("p", len(NAMES))
    q, qdot = x[:3], x[3:]
    torque_q = _rate_jacobian(ca, q).T @ (torque_matrix(parameters)(q) @ u)
    friction = p[4:7] + p[7:10] / ca.sqrt(qdot**2 + parameters.friction_smoothing_rad_s**2)
    net = torque_q - friction * qdot - p[10:13] * q - p[13:16]
    acceleration = rigid_body()(q, qdot, net, p[:4])
    return ca.Function("f", [x, u, p], [ca.vertcat(qdot, acceleration)], ["x", "u", "p"], ["xdot"])


def rigid_body() -> Any:
    """Return the hinge accelerations of a rigid rotor on three ideal hinges.

    The Coriolis torque is the derivative of the kinetic energy, and not the closed form of
    `models.lagrangian`.

    Returns
    -------
    casadi.Function
        ``(q, qdot, torque, p) -> qddot``: torque (3,) on the hinges, N·m, p (4,) of three principal inertias
        (kg·m²) and the weight moment (N·m).
    """
    ca = library()
    q, qdot, torque, p = (ca.SX.sym(name, size) for name, size in (("q", 3), ("v", 3), ("t", 3), ("p", 4)))
    cb, sb, cg, sg = ca.cos(q[1]), ca.sin(q[1]), ca.cos(q[2]), ca.sin(q[2])
    B = ca.vertcat(ca.horzcat(cb * cg, sg, 0), ca.horzcat(-cb * sg, cg, 0), ca.horzcat(sb, 0, 1))
    M = B.T @ ca.diag(p[:3]) @ B
    momentum = M @ qdot
    potential = p[3] * ca.cos(q[0]) * ca.cos(q[1])
    bias = ca.jtimes(momentum, q, qdot) - ca.gradient(ca.dot(qdot, momentum) / 2 - potential, q)
    return ca.Function("rigid_body", [q, qdot, torque, p], [ca.inv(M) @ (torque - bias)])


def torque_matrix(parameters: Parameters) -> Any:
    """Return the torque matrix of a plant.

    It evaluates the cubic pieces of the compiled torque matrix, as a B-spline with fourfold knots.

    Returns
    -------
    casadi.Function
        ``q -> G`` (3, n), N·m/A: torque on the rotor per ampere of each group, stator frame.

    Raises
    ------
    InputError
        The magnetics are not those of a torque curve, or casadi is not installed.
    """
    ca, model = library(), parameters.magnetics
    if not model.table.size:
        raise InputError(
            "casadi: expected an actuator with a torque curve, received one with a torque field, which has no"
            " CasADi function"
        )
    q = ca.MX.sym("q", 3)
    axes_S = ca.DM(model.line_axes) @ _rotation(ca, q).T  # (lines, 3)
    cosine = ca.fmin(ca.fmax(axes_S @ ca.DM(model.group_axes), -1), 1)  # (lines, n)
    side, shape = ca.if_else(cosine < 0, -1, 1), cosine.shape
    scatters = model.pair_gain.shape[1] > 0
    if scatters:
        stretch, step = (ca.DM(row.reshape(shape)) for row in model.pair_stretch)
        cosine += (stretch + side * step) * (side - cosine)
    pull = _curve(ca, model.table).map(cosine.numel())(ca.vec(cosine).T).reshape(shape)
    if scatters:
        gain, step = (ca.DM(row.reshape(shape)) for row in model.pair_gain)
        pull *= gain + side * step
    weighted = axes_S * ca.repmat(ca.DM(model.line_weights), 1, 3)
    forces, s = weighted.T @ pull, ca.DM(model.group_axes)  # (3, n)
    G = ca.vertcat(
        forces[1, :] * s[2, :] - forces[2, :] * s[1, :],
        forces[2, :] * s[0, :] - forces[0, :] * s[2, :],
        forces[0, :] * s[1, :] - forces[1, :] * s[0, :],
    )
    gained = G * ca.repmat(ca.DM(parameters.torque_gain).T, 3, 1)
    return ca.Function("torque_matrix", [q], [gained], ["q"], ["G"])


def _check(parameters: Parameters) -> None:
    if parameters.joint["on"][0]:
        raise InputError("casadi: expected a plant with an ideal joint, received plant.mass or such a model")


def _curve(ca: Any, table: Array) -> Any:
    """Return the odd function h of a cosine (`TorqueModel`) from its table of cubics."""
    narrow, wide = round((1 - KNEE) * NARROW_PER_UNIT), round(2 * KNEE * WIDE_PER_UNIT)
    rising = np.arange(narrow + 1) / NARROW_PER_UNIT
    edges = np.concatenate([rising - 1, np.arange(1, wide) / WIDE_PER_UNIT - KNEE, KNEE + rising])
    c0, c1, c2, c3 = table[: len(edges) - 1].T
    bernstein = np.stack([c0, c0 + c1 / 3, c0 + (2 * c1 + c2) / 3, c0 + c1 + c2 + c3], axis=1)
    cosine = ca.MX.sym("c")
    pieces = ca.bspline(
        cosine, ca.DM(bernstein.ravel()), [np.repeat(edges, 4).tolist()], [3], 1, {"lookup_mode": ["binary"]}
    )
    return ca.Function("h", [cosine], [pieces])


def _rotation(ca: Any, q: Any) -> Any:
    """Return R_SR of `kinematics.rotation`."""
    turns = []
    for axis in range(3):
        c, s, i, j = ca.cos(q[axis]), ca.sin(q[axis]), (axis + 1) % 3, (axis + 2) % 3
        R = ca.MX.eye(3)
        R[i, i], R[i, j], R[j, i], R[j, j] = c, -s, s, c
        turns.append(R)
    return turns[0] @ turns[1] @ turns[2]


def _rate_jacobian(ca: Any, q: Any) -> Any:
    """Return E of `kinematics.rate_jacobian`."""
    c, s, cb, sb = ca.cos(q[0]), ca.sin(q[0]), ca.cos(q[1]), ca.sin(q[1])
    return ca.vertcat(ca.horzcat(1, 0, sb), ca.horzcat(0, c, -s * cb), ca.horzcat(0, s, c * cb))
