"""What the nominal model asks for: the torque ``M(q) a + C(q, qdot) v`` of an acceleration and a rate (1)."""

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import compiled
from spheretwin.models.lagrangian import coriolis_matrix, inertia_matrix

Array = NDArray[np.float64]


@compiled
def model_torque(measurement: Array, acceleration: Array, rate: Array, inertia: Array, torque: Array) -> None:
    """Write the torque at the measured pose and rates.

    Parameters
    ----------
    measurement : (3, 3) array
        As a law is handed it: angle and rate as its first rows.
    acceleration, rate : (3,) array, rad/s² and rad/s
        What M and C are multiplied with.
    inertia : (3,) array, kg·m²
        Nominal principal inertias.
    torque : (3,) array, N·m
        Result.
    """
    M, C = inertia_matrix(measurement[0], inertia), coriolis_matrix(measurement[0], measurement[1], inertia)
    for i in range(3):
        torque[i] = 0.0
        for j in range(3):
            torque[i] += M[i, j] * acceleration[j] + C[i, j] * rate[j]
