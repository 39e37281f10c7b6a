"""Equations of motion from the Lagrangian, independent of the physics engine.

``M(q) qddot + C(q, qdot) qdot + G = tau_c - tau_d`` (1), for a rotor whose centre of mass lies at
the joint centre, so that ``G = 0``. ``inertia`` holds the principal inertias (J1, J2, J3).

A payload is a point mass on the shaft, at the height l on the rotor's third axis. With the rotor's
angular velocity (w1, w2, w3) in its own frame the mass moves at ``l sqrt(w1**2 + w2**2)``, so its kinetic
energy ``m l**2 (w1**2 + w2**2) / 2`` adds ``m l**2`` to J1 and J2 and changes the form of neither M nor C;
its potential energy is ``V = m g l cos(alpha) cos(beta)``, whose gradient is G.

Each formula is implemented once, on scalars: arrays of three are too slow for a plant with thousands of steps
per second. The functions with arrays call those on scalars.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import compiled, inlined
from spheretwin.models.kinematics import Triple, Turns, triple, turns

GRAVITY_m_s2 = 9.81


class InertiaEntries(NamedTuple):
    """Distinct entries of the inertia matrix, kg·m²."""

    alpha: float
    beta: float
    gamma: float
    alpha_beta: float
    alpha_gamma: float
    beta_gamma: float  # zero for an ideal joint


@compiled
def inertia_matrix(q: NDArray[np.float64], inertia: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the inertia matrix ``M(q) = B^T diag(J) B`` (2).

    Parameters
    ----------
    q : (3,) array, rad
        Pose.
    inertia : (3,) array, kg·m²
        Principal inertias of the rotor.

    Returns
    -------
    (3, 3) array, kg·m²
        Symmetric; positive definite away from beta = +-90 degrees.
    """
    entries = inertia_entries(turns(triple(q)), triple(inertia))
    M = np.zeros((3, 3))
    M[0, 0], M[1, 1], M[2, 2] = entries.alpha, entries.beta, entries.gamma
    M[0, 1] = M[1, 0] = entries.alpha_beta
    M[0, 2] = M[2, 0] = entries.alpha_gamma
    return M


@compiled
def coriolis_matrix(
    q: NDArray[np.float64], qdot: NDArray[np.float64], inertia: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the Coriolis and centrifugal matrix in Christoffel form: ``Mdot - 2C`` is skew-symmetric.

    Parameters
    ----------
    q : (3,) array, rad
        Pose.
    qdot : (3,) array, rad/s
        Hinge rates.
    inertia : (3,) array, kg·m²
        Principal inertias of the rotor.

    Returns
    -------
    (3, 3) array, kg·m²/s
        C(q, qdot); derived anew, as the paper's appendix is damaged in print.
    """
    C = np.empty((3, 3))
    for i, row in enumerate(coriolis_rows(turns(triple(q)), triple(qdot), triple(inertia))):
        C[i, 0], C[i, 1], C[i, 2] = row
    return C


def loaded_inertia(
    inertia: NDArray[np.float64], payload_kg: float | NDArray[np.float64], height_m: float
) -> NDArray[np.float64]:
    """Return the principal inertias about the joint centre with a point mass on the third axis.

    Parameters
    ----------
    inertia : (3,) or (n, 3) array, kg·m²
        Principal inertias of the rotor alone.
    payload_kg : float or (n, 1) array, kg
        The point mass.
    height_m : float, m
        Its distance from the joint centre.

    Returns
    -------
    (3,) or (n, 3) array, kg·m²
        ``J + m l**2`` on the two axes normal to the shaft.
    """
    return inertia + payload_kg * height_m**2 * np.array([1.0, 1.0, 0.0])


@compiled
def gravity_torque(q: NDArray[np.float64], weight_moment: float) -> NDArray[np.float64]:
    """Return the generalised torque G of gravity, the gradient of ``weight_moment cos(alpha) cos(beta)``.

    Parameters
    ----------
    q : (3,) array, rad
        Pose.
    weight_moment : float, N·m
        m g l of the payload; 0 for the bare rotor, whose G is 0 (2).

    Returns
    -------
    (3,) array, N·m
        On the left side of (1): a positive entry requires a positive torque at rest.
    """
    G = np.empty(3)
    G[0], G[1], G[2] = gravity_entries(turns(triple(q)), weight_moment)
    return G


def gravity_stiffness(q: NDArray[np.float64], weight_moment: float) -> NDArray[np.float64]:
    """Return the derivative of `gravity_torque` with respect to the pose, for small motions.

    Parameters
    ----------
    q : (3,) array, rad
        Pose.
    weight_moment : float, N·m
        m g l of the payload.

    Returns
    -------
    (3, 3) array, N·m/rad
        The Hessian of the potential energy; negative definite in (alpha, beta) for an upright payload.
    """
    at = turns(triple(q))
    stiffness = np.zeros((3, 3))
    stiffness[0, 0] = stiffness[1, 1] = -weight_moment * at.ca * at.cb
    stiffness[0, 1] = stiffness[1, 0] = weight_moment * at.sa * at.sb
    return stiffness


@compiled
def acceleration(
    q: NDArray[np.float64],
    qdot: NDArray[np.float64],
    torque: NDArray[np.float64],
    inertia: NDArray[np.float64],
    weight_moment: float,
) -> NDArray[np.float64]:
    """Return the hinge accelerations that solve the equation of motion (1).

    Parameters
    ----------
    q : (3,) array, rad
        Pose, away from beta = +-90 degrees.
    qdot : (3,) array, rad/s
        Hinge rates.
    torque : (3,) array, N·m
        Generalised torque, all of it: ``tau_c - tau_d``.
    inertia : (3,) array, kg·m²
        Principal inertias about the joint centre, payload included.
    weight_moment : float, N·m
        m g l of the payload.

    Returns
    -------
    (3,) array, rad/s²
        ``M**-1 (torque - C qdot - G)``.
    """
    qddot = np.empty(3)
    qddot[0], qddot[1], qddot[2] = acceleration_entries(
        turns(triple(q)), triple(qdot), triple(torque), triple(inertia), weight_moment
    )
    return qddot


@compiled
def coupling_torques(
    q: NDArray[np.float64], qdot: NDArray[np.float64], qddot: NDArray[np.float64], inertia: float
) -> NDArray[np.float64]:
    """Return the coupling torques between the axes for three equal inertias, (6) to (10).

    Parameters
    ----------
    q, qdot, qddot : (3,) array, rad, rad/s and rad/s²
        Pose, hinge rates and accelerations.
    inertia : float, kg·m²
        J = J1 = J2 = J3.

    Returns
    -------
    (2, 3) array, N·m
        Inertial terms (6), (9) and Coriolis terms (7), (8), (10) on (alpha, beta, gamma). Added to
        ``J qddot`` they are the whole left side of (3) to (5).
    """
    cb, sb = np.cos(q[1]), np.sin(q[1])
    coupling = np.zeros((2, 3))
    coupling[0, 0] = inertia * sb * qddot[2]
    coupling[0, 2] = inertia * sb * qddot[0]
    coupling[1, 0] = inertia * cb * qdot[1] * qdot[2]
    coupling[1, 1] = -inertia * cb * qdot[0] * qdot[2]
    coupling[1, 2] = inertia * cb * qdot[0] * qdot[1]
    return coupling


@inlined
def inertia_entries(at: Turns, inertia: Triple) -> InertiaEntries:
    """Return the entries of `inertia_matrix` (kg·m²)."""
    J1, J2, J3 = inertia
    return InertiaEntries(
        alpha=(J1 * at.cg**2 + J2 * at.sg**2) * at.cb**2 + J3 * at.sb**2,
        beta=J1 * at.sg**2 + J2 * at.cg**2,
        gamma=J3,
        alpha_beta=(J1 - J2) * at.cb * at.cg * at.sg,
        alpha_gamma=J3 * at.sb,
        beta_gamma=0.0,
    )


@inlined
def coriolis_rows(at: Turns, qdot: Triple, inertia: Triple) -> tuple[Triple, Triple, Triple]:
    """Return the rows of `coriolis_matrix` (kg·m²/s)."""
    J1, J2, J3 = inertia
    alpha_rate, beta_rate, gamma_rate = qdot
    cb, sb, cg, sg = at.cb, at.sb, at.cg, at.sg
    D = J1 - J2
    D_double_angle = D * cb * (cg**2 - sg**2)
    tilt = (J3 - J1 * cg**2 - J2 * sg**2) * sb * cb
    sum_half = 0.5 * (D_double_angle + J3 * cb)
    difference_half = 0.5 * (D_double_angle - J3 * cb)
    first = (
        tilt * beta_rate - D * cb**2 * sg * cg * gamma_rate,
        tilt * alpha_rate - D * sb * sg * cg * beta_rate + sum_half * gamma_rate,
        -D * cb**2 * sg * cg * alpha_rate + sum_half * beta_rate,
    )
    second = (
        -tilt * alpha_rate + difference_half * gamma_rate,
        D * sg * cg * gamma_rate,
        difference_half * alpha_rate + D * sg * cg * beta_rate,
    )
    third = (
        D * cb**2 * sg * cg * alpha_rate - difference_half * beta_rate,
        -difference_half * alpha_rate - D * sg * cg * beta_rate,
        0.0,
    )
    return first, second, third


@inlined
def gravity_entries(at: Turns, weight_moment: float) -> Triple:
    """Return the entries of `gravity_torque` (N·m)."""
    return -weight_moment * at.sa * at.cb, -weight_moment * at.ca * at.sb, 0.0


@inlined
def acceleration_entries(
    at: Turns, qdot: Triple, torque: Triple, inertia: Triple, weight_moment: float
) -> Triple:
    """Return the entries of `acceleration` (rad/s²)."""
    C_alpha, C_beta, C_gamma = coriolis_rows(at, qdot, inertia)
    G = gravity_entries(at, weight_moment)
    net = (
        torque[0] - C_alpha[0] * qdot[0] - C_alpha[1] * qdot[1] - C_alpha[2] * qdot[2] - G[0],
        torque[1] - C_beta[0] * qdot[0] - C_beta[1] * qdot[1] - C_beta[2] * qdot[2] - G[1],
        torque[2] - C_gamma[0] * qdot[0] - C_gamma[1] * qdot[1] - C_gamma[2] * qdot[2] - G[2],
    )
    return solve_inertia(inertia_entries(at, inertia), net, False)


@inlined
def solve_inertia(M: InertiaEntries, torque: Triple, general: bool) -> Triple:
    """Solve ``M x = torque`` for an inertia matrix, or its sum with a diagonal matrix, also a complex one.

    M is eliminated from its last row upward. It is positive definite, so that no pivoting is needed. It is
    `general` if its entry (beta, gamma) is not zero, as that of an ideal joint: this order then divides by
    two diagonal entries that never vanish.
    """
    if general:
        from_alpha, from_beta = M.alpha_gamma / M.gamma, M.beta_gamma / M.gamma
        coupling, b = M.alpha_beta - from_alpha * M.beta_gamma, M.beta - from_beta * M.beta_gamma
        on_beta, share = torque[1] - from_beta * torque[2], coupling / b
        left = M.alpha - from_alpha * M.alpha_gamma - share * coupling
        alpha = (torque[0] - from_alpha * torque[2] - share * on_beta) / left
        beta = on_beta / b - share * alpha
        return alpha, beta, torque[2] / M.gamma - from_alpha * alpha - from_beta * beta
    of_beta, of_gamma = 1.0 / M.beta, 1.0 / M.gamma
    to_beta, to_gamma = M.alpha_beta * of_beta, M.alpha_gamma * of_gamma
    left = M.alpha - to_beta * M.alpha_beta - to_gamma * M.alpha_gamma
    alpha = (torque[0] - to_beta * torque[1] - to_gamma * torque[2]) / left
    return alpha, torque[1] * of_beta - to_beta * alpha, torque[2] * of_gamma - to_gamma * alpha
