"""How far the rotor is turned away from where it should be: one angle for all three hinges."""

from __future__ import annotations

import numpy as np

from spheretwin.viz.quantities.quantity import Array, Quantity, Rows
from spheretwin.viz.scene.poses import body_quaternions


def values(rows: Rows) -> Array:
    """Angle of ``R_ref^T R``, (n, 1) in degrees."""
    return np.degrees(angle_between(rows.table["q_rad"], rows.table["q_ref_rad"]))[:, None]


def angle_between(q: Array, q_ref: Array) -> Array:
    """Angle of the one rotation between two orientations, (n,) in rad, of hinge angles (n, 3) in rad."""
    actual, desired = body_quaternions(q)["rotor"], body_quaternions(q_ref)["rotor"]
    # The vector part as well as the scalar: near 1 the scalar alone would lose half of the digits.
    along = np.abs(np.sum(actual * desired, axis=1))
    across = (
        desired[:, 3:] * actual[:, :3]
        - actual[:, 3:] * desired[:, :3]
        - np.cross(desired[:, :3], actual[:, :3])
    )
    return np.asarray(2 * np.arctan2(np.sqrt(np.sum(across**2, axis=1)), along))


ERROR_ANGLE = Quantity("error_angle_deg", "°", "angle between the rotor and where it should be", values, 0.01)
