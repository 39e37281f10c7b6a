"""Equations of motion from the Lagrangian, independent of the physics engine.

``M(q) qddot + C(q, qdot) qdot + G = tau_c - tau_d`` (1), for a rotor whose centre of mass lies at
the joint centre, so that ``G = 0``. ``inertia`` holds the principal inertias (J1, J2, J3).

A payload is a point mass on the shaft, at the height l on the rotor's third axis. With the rotor's
angular velocity (w1, w2, w3) in its own frame the mass moves at ``l sqrt(w1**2 + w2**2)``, so its kinetic
energy ``m l**2 (w1**2 + w2**2) / 2`` adds ``m l**2`` to J1 and J2 and changes the form of neither M nor C;
its potential energy is ``V = m g l cos(alpha) cos(beta)``, whose gradient is G.
"""

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.compiled import compiled

GRAVITY_m_s2 = 9.81


@compiled
def inertia_matrix(q: NDArray[np.float64], inertia: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inertia matrix ``M(q) = B^T diag(J) B`` (2).

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
    J1, J2, J3 = inertia[0], inertia[1], inertia[2]
    cb, sb = np.cos(q[1]), np.sin(q[1])
    cg, sg = np.cos(q[2]), np.sin(q[2])
    M = np.zeros((3, 3))
    M[0, 0] = (J1 * cg**2 + J2 * sg**2) * cb**2 + J3 * sb**2
    M[0, 1] = M[1, 0] = (J1 - J2) * cb * cg * sg
    M[0, 2] = M[2, 0] = J3 * sb
    M[1, 1] = J1 * sg**2 + J2 * cg**2
    M[2, 2] = J3
    return M


@compiled
def coriolis_matrix(
    q: NDArray[np.float64], qdot: NDArray[np.float64], inertia: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Coriolis and centrifugal matrix in Christoffel form, so that ``Mdot - 2C`` is skew-symmetric.

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
    J1, J2, J3 = inertia[0], inertia[1], inertia[2]
    alpha_rate, beta_rate, gamma_rate = qdot[0], qdot[1], qdot[2]
    cb, sb = np.cos(q[1]), np.sin(q[1])
    cg, sg = np.cos(q[2]), np.sin(q[2])
    D = J1 - J2
    D_double_angle = D * cb * (cg**2 - sg**2)
    tilt = (J3 - J1 * cg**2 - J2 * sg**2) * sb * cb
    sum_half = 0.5 * (D_double_angle + J3 * cb)
    difference_half = 0.5 * (D_double_angle - J3 * cb)
    C = np.zeros((3, 3))
    C[0, 0] = tilt * beta_rate - D * cb**2 * sg * cg * gamma_rate
    C[0, 1] = tilt * alpha_rate - D * sb * sg * cg * beta_rate + sum_half * gamma_rate
    C[0, 2] = -D * cb**2 * sg * cg * alpha_rate + sum_half * beta_rate
    C[1, 0] = -tilt * alpha_rate + difference_half * gamma_rate
    C[1, 1] = D * sg * cg * gamma_rate
    C[1, 2] = difference_half * alpha_rate + D * sg * cg * beta_rate
    C[2, 0] = D * cb**2 * sg * cg * alpha_rate - difference_half * beta_rate
    C[2, 1] = -difference_half * alpha_rate - D * sg * cg * beta_rate
    return C


def loaded_inertia(inertia: NDArray[np.float64], payload_kg: float, height_m: float) -> NDArray[np.float64]:
    """Principal inertias about the joint centre with a point mass on the third axis.

    Parameters
    ----------
    inertia : (3,) array, kg·m²
        Principal inertias of the rotor alone.
    payload_kg : float, kg
        The point mass.
    height_m : float, m
        Its distance from the joint centre.

    Returns
    -------
    (3,) array, kg·m²
        ``J + m l**2`` on the two axes normal to the shaft.
    """
    return inertia + payload_kg * height_m**2 * np.array([1.0, 1.0, 0.0])


@compiled
def gravity_torque(q: NDArray[np.float64], weight_moment: float) -> NDArray[np.float64]:
    """Gravity's generalised torque G, the gradient of ``weight_moment cos(alpha) cos(beta)``.

    Parameters
    ----------
    q : (3,) array, rad
        Pose.
    weight_moment : float, N·m
        m g l of the payload; 0 for the bare rotor, whose G is 0 (2).

    Returns
    -------
    (3,) array, N·m
        On the left side of (1), so that a positive entry has to be held by a positive torque.
    """
    G = np.zeros(3)
    G[0] = -weight_moment * np.sin(q[0]) * np.cos(q[1])
    G[1] = -weight_moment * np.cos(q[0]) * np.sin(q[1])
    return G


@compiled
def acceleration(
    q: NDArray[np.float64],
    qdot: NDArray[np.float64],
    torque: NDArray[np.float64],
    inertia: NDArray[np.float64],
    weight_moment: float,
) -> NDArray[np.float64]:
    """Hinge accelerations that solve the equation of motion (1).

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

    Notes
    -----
    M is eliminated from its last row upward. It is positive definite, so that no order needs pivots, and
    as its entry (2, 3) is zero this order divides by two diagonal entries that never vanish.
    """
    M = inertia_matrix(q, inertia)
    C = coriolis_matrix(q, qdot, inertia)
    G = gravity_torque(q, weight_moment)
    net = np.empty(3)
    for i in range(3):
        net[i] = torque[i] - C[i, 0] * qdot[0] - C[i, 1] * qdot[1] - C[i, 2] * qdot[2] - G[i]
    to_beta, to_gamma = M[0, 1] / M[1, 1], M[0, 2] / M[2, 2]
    left = M[0, 0] - to_beta * M[0, 1] - to_gamma * M[0, 2]
    qddot = np.empty(3)
    qddot[0] = (net[0] - to_beta * net[1] - to_gamma * net[2]) / left
    qddot[1] = net[1] / M[1, 1] - to_beta * qddot[0]
    qddot[2] = net[2] / M[2, 2] - to_gamma * qddot[0]
    return qddot


@compiled
def coupling_torques(
    q: NDArray[np.float64], qdot: NDArray[np.float64], qddot: NDArray[np.float64], inertia: float
) -> NDArray[np.float64]:
    """Torques that the axes exert on each other where the three inertias are equal, (6) to (10).

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
