"""Equations of motion from the Lagrangian, independent of the physics engine.

``M(q) qddot + C(q, qdot) qdot + G = tau_c - tau_d`` (1), for a rotor whose centre of mass lies at
the joint centre, so that ``G = 0``. ``inertia`` holds the principal inertias (J1, J2, J3).
"""

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.compiled import compiled


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
