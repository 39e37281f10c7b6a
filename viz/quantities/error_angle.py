"""How far the rotor is turned away from where it should be: one angle for all three hinges."""

from __future__ import annotations

import numpy as np

from spheretwin.viz.quantities.quantity import Array, Quantity, Rows


def values(rows: Rows) -> Array:
    """Angle of ``R_ref^T R``, (n, 1) in degrees."""
    return np.degrees(angle_between(rows.table["q_rad"], rows.table["q_ref_rad"]))[:, None]


def angle_between(q: Array, desired: Array) -> Array:
    """Angle of the one rotation between two orientations, (n,) in rad, of hinge angles (n, 3) in rad.

    It is that of ``Ry(-β_ref) Rx(α - α_ref) Ry(β) Rz(γ - γ_ref)``, of which this is the quaternion. Its
    vector part counts as well as its scalar: near 1 the scalar alone would lose half of the digits.
    """
    difference, sum_beta = (q - desired) / 2, (q[:, 1] + desired[:, 1]) / 2
    (ca, cb, cg), (sa, sb, sg) = np.cos(difference).T, np.sin(difference).T
    w, z = ca * cb, sa * np.sin(sum_beta)
    along = w * cg - z * sg
    across = (sa * np.cos(sum_beta)) ** 2 + (ca * sb) ** 2 + (z * cg + w * sg) ** 2
    return np.asarray(2 * np.arctan2(np.sqrt(across), np.abs(along)))


ERROR_ANGLE = Quantity("error_angle_deg", "°", "angle between the rotor and where it should be", values, 0.01)
