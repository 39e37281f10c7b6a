"""Equations of motion and torque matrix as CasADi functions."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.extras import missing
from spheretwin.models.kinematics import generalised_torque, rotation_rows
from spheretwin.models.lagrangian import acceleration_entries
from spheretwin.models.magnetics import KNEE, NARROW_PER_UNIT, WIDE_PER_UNIT
from spheretwin.models.symbolic import on_symbols, turns_by
from spheretwin.plant.plant_step import Parameters

NAMES = (
    *(f"inertia_{axis}_kg_m2" for axis in "xyz"),
    "weight_moment_Nm",
    *(f"viscous_{hinge}_Nm_s" for hinge in ("alpha", "beta", "gamma")),
    *(f"coulomb_{hinge}_Nm" for hinge in ("alpha", "beta", "gamma")),
    *(f"spring_{hinge}_Nm_rad" for hinge in ("alpha", "beta", "gamma")),
    *(f"disturbance_{hinge}_Nm" for hinge in ("alpha", "beta", "gamma")),
    *(f"coulomb_asymmetry_{hinge}" for hinge in ("alpha", "beta", "gamma")),
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
            parameters.coulomb_asymmetry,
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
        ``f(x, u, p) -> xdot``: x and xdot (6,) of angles (rad) and rates, u (n,) currents in A, p (19,).

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
    on_hinges: list[Any] = [None] * 3
    torque_S = ca.vertsplit(torque_matrix(parameters)(q) @ u)
    _symbolic(ca, generalised_torque)(ca.vertsplit(q), torque_S, on_hinges)
    coulomb = p[7:10] * (1 + ca.sign(qdot) * p[16:19])
    friction = p[4:7] + coulomb / ca.sqrt(qdot**2 + parameters.friction_smoothing_rad_s**2)
    net = ca.vertcat(*on_hinges) - friction * qdot - p[10:13] * q - p[13:16]
    acceleration = rigid_body()(q, qdot, net, p[:4])
    return ca.Function("f", [x, u, p], [ca.vertcat(qdot, acceleration)], ["x", "u", "p"], ["xdot"])


def rigid_body() -> Any:
    """Return the hinge accelerations of a rigid rotor on three ideal hinges: `lagrangian.acceleration`.

    Returns
    -------
    casadi.Function
        ``(q, qdot, torque, p) -> qddot``: torque (3,) on the hinges, N·m, p (4,) of three principal inertias
        (kg·m²) and the weight moment (N·m).
    """
    ca = library()
    q, qdot, torque, p = (ca.SX.sym(name, size) for name, size in (("q", 3), ("v", 3), ("t", 3), ("p", 4)))
    *inertia, weight_moment = ca.vertsplit(p)
    at = turns_by(ca.cos, ca.sin)(ca.vertsplit(q))
    vectors = ca.vertsplit(qdot), ca.vertsplit(torque)
    qddot = _symbolic(ca, acceleration_entries)(at, *vectors, inertia, weight_moment)
    return ca.Function("rigid_body", [q, qdot, torque, p], [ca.vertcat(*qddot)])


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
    ca, curve = library(), parameters.magnetics.tables.curve
    if not curve.size:
        raise InputError(
            "casadi: expected an actuator with a torque curve, received one with a torque field, which has no"
            " CasADi function"
        )
    q, model = ca.MX.sym("q", 3), parameters.magnetics.arrangement[0]
    rows = _symbolic(ca, rotation_rows)(ca.vertsplit(q))
    rotation = ca.vertcat(*(ca.horzcat(*row) for row in rows))
    axes_S = ca.DM(model.line_axes) @ rotation.T  # (lines, 3)
    cosine = ca.fmin(ca.fmax(axes_S @ ca.DM(model.group_axes), -1), 1)  # (lines, n)
    side, shape = ca.if_else(cosine < 0, -1, 1), cosine.shape
    if model.scattered:
        stretch, step = (ca.DM(row.reshape(shape)) for row in model.pair_stretch)
        cosine += (stretch + side * step) * (side - cosine)
    pull = _curve(ca, curve).map(cosine.numel())(ca.vec(cosine).T).reshape(shape)
    if model.scattered:
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
    """Return the odd function h of a cosine (`Arrangement`) from its table of cubics."""
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


def _symbolic(ca: Any, function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of the model on symbols of CasADi."""
    return on_symbols(function, turns=turns_by(ca.cos, ca.sin))
