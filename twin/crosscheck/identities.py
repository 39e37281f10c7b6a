"""Identities of the Lagrangian model: skew symmetry, and the paper's coupling terms."""

from __future__ import annotations

import numpy as np

from spheretwin.crosscheck.dynamics import random_states
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.checks import Check, Checks
from spheretwin.models.kinematics import rotor_rate_jacobian
from spheretwin.models.lagrangian import coriolis_matrix, coupling_torques, inertia_matrix

# A handful of products and sums, each rounded at 1e-16, divided by the size of the terms.
BOUND = 1e-14

_WHY_EXACT = "rounding alone, near 1e-16: both sides are exact"


def check_identities(actuator: Actuator, count: int) -> Checks:
    """Check the identities at random states."""
    states = random_states(count)
    return Checks(
        [
            _skew_symmetry(actuator.inertia, states.q, states.qdot),
            _coupling(float(np.mean(actuator.inertia)), states.q, states.qdot, states.qddot),
        ]
    )


def inertia_rate(q: Array, qdot: Array, inertia: Array) -> Array:
    """Rate of M(q) along the motion, from kinematics alone: neither Christoffel symbols nor differences.

    ``M = B^T J B``, and the columns of B are the hinge axes seen from the rotor. The axis of γ is fixed
    there; that of β turns about it at -γ̇; that of α, fixed in the stator, turns at minus the rotor's
    angular velocity. So Ḃ is exact, and ``Mdot = Bdot^T J B + B^T J Bdot``.

    Parameters
    ----------
    q, qdot : (3,) array, rad and rad/s
        State.
    inertia : (3,) array, kg·m²
        Principal inertias.

    Returns
    -------
    (3, 3) array, kg·m²/s
        Exact to rounding.
    """
    B = rotor_rate_jacobian(q)
    w_SR_R = B @ qdot
    B_rate = np.stack(
        [-np.cross(w_SR_R, B[:, 0]), -np.cross(qdot[2] * B[:, 2], B[:, 1]), np.zeros(3)], axis=1
    )
    half: Array = B_rate.T @ (inertia[:, None] * B)
    return half + half.T


def _skew_symmetry(inertia: Array, q: Array, qdot: Array) -> Check:
    worst = 0.0
    for pose, rates in zip(q, qdot, strict=True):
        M_rate = inertia_rate(pose, rates, inertia)
        C = coriolis_matrix(pose, rates, inertia)
        symmetric = M_rate - C - C.T  # half of (Ṁ - 2C) + (Ṁ - 2C)ᵀ
        size = np.linalg.norm(M_rate) + 2 * np.linalg.norm(C)
        worst = np.maximum(worst, np.linalg.norm(symmetric) / size)
    return Check(
        name="Ṁ - 2C is skew-symmetric",
        compares="Ṁ from the turning of the hinge axes, C from the Christoffel form;"
        " symmetric part over |Ṁ| + 2|C|",
        states=len(q),
        value=float(worst),
        bound=BOUND,
        why=_WHY_EXACT,
    )


def _coupling(J: float, q: Array, qdot: Array, qddot: Array) -> Check:
    equal = np.full(3, J)
    worst = 0.0
    for pose, rates, accelerations in zip(q, qdot, qddot, strict=True):
        M, C = inertia_matrix(pose, equal), coriolis_matrix(pose, rates, equal)
        full = M @ accelerations + C @ rates
        terms = J * accelerations + coupling_torques(pose, rates, accelerations, J).sum(axis=0)
        size = np.linalg.norm(M) * np.linalg.norm(accelerations) + np.linalg.norm(C) * np.linalg.norm(rates)
        worst = np.maximum(worst, np.linalg.norm(full - terms) / size)
    return Check(
        name="coupling torques (3)-(10)",
        compares="M q̈ + C q̇ at J1 = J2 = J3 with the paper's terms; difference over |M||q̈| + |C||q̇|",
        states=len(q),
        value=float(worst),
        bound=BOUND,
        why=_WHY_EXACT,
    )
