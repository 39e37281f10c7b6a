"""Torque of the coils in the frame in which it is commanded."""

from __future__ import annotations

import numpy as np

from spheretwin.viz.quantities.quantity import Array, Rows, by_axis


def values(rows: Rows) -> Array:
    """Generalised torque ``E^T torque_S`` at the pose of the tick, (n, 3) in N·m."""
    return on_the_hinges(rows.table["q_rad"], rows.table["torque_Nm"])


def on_the_hinges(q: Array, torque_S: Array) -> Array:
    """Generalised torque of torques of the stator frame (n, 3) in N·m, at hinge angles (n, 3) in rad."""
    x, y, z = torque_S.T
    ca, sa = np.cos(q[:, 0]), np.sin(q[:, 0])
    cb, sb = np.cos(q[:, 1]), np.sin(q[:, 1])
    return np.stack([x, ca * y + sa * z, sb * x + cb * (ca * z - sa * y)], axis=1)


DELIVERED = by_axis("torque_delivered_Nm", "N·m", "generalised torque of the coils", values, floor=0.02)
