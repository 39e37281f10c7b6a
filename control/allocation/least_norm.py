"""Least-norm allocation of a torque on the rotor to group currents within their limit (16)."""

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import allocation_free

# Below this share of the torque matrix's size, squared, a direction counts as lost: the currents for it
# would be a million times those for the strongest direction.
SINGULAR = 1e-12


@allocation_free
def allocate(
    G: NDArray[np.float64], torque_S: NDArray[np.float64], limit: float, current: NDArray[np.float64]
) -> float:
    """Compute least-norm currents ``I = G^T (G G^T)^-1 torque`` (16), scaled as a whole to respect the limit.

    Equal scaling of all currents keeps the direction of the torque.

    Parameters
    ----------
    G : (3, n) array, N·m/A
        Torque matrix at the present pose.
    torque_S : (3,) array, N·m
        Desired torque on the rotor, stator frame.
    limit : float, A
        Largest magnitude of any current.
    current : (n,) array, A
        Result.

    Returns
    -------
    float
        Share of the desired torque that the currents give: 1, or less if the limit is active;
        0 if the torque matrix has lost rank.
    """
    groups = G.shape[1]
    a = b = c = d = e = f = 0.0
    for j in range(groups):  # G G^T = [[a, b, c], [b, d, e], [c, e, f]]
        a += G[0, j] * G[0, j]
        b += G[0, j] * G[1, j]
        c += G[0, j] * G[2, j]
        d += G[1, j] * G[1, j]
        e += G[1, j] * G[2, j]
        f += G[2, j] * G[2, j]
    cofactor_0, cofactor_1, cofactor_2 = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * cofactor_0 + b * cofactor_1 + c * cofactor_2
    if not determinant > SINGULAR * (a + d + f) ** 3:
        current[:] = 0.0
        return 0.0
    x, y, z = torque_S[0] / determinant, torque_S[1] / determinant, torque_S[2] / determinant
    weight_0 = cofactor_0 * x + cofactor_1 * y + cofactor_2 * z
    weight_1 = cofactor_1 * x + (a * f - c * c) * y + (b * c - a * e) * z
    weight_2 = cofactor_2 * x + (b * c - a * e) * y + (a * d - b * b) * z
    largest = 0.0
    for j in range(groups):
        current[j] = G[0, j] * weight_0 + G[1, j] * weight_1 + G[2, j] * weight_2
        largest = max(largest, abs(current[j]))
    if largest <= limit:
        return 1.0
    scale = limit / largest
    for j in range(groups):
        # The product may round past the limit by one bit.
        current[j] = min(max(current[j] * scale, -limit), limit)
    return scale
