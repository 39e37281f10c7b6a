"""How far the shaft's tip is from where it should be."""

from __future__ import annotations

import numpy as np

from spheretwin.viz.quantities.quantity import Array, Quantity, Rows
from spheretwin.viz.scene.poses import shaft_tip


def values(rows: Rows) -> Array:
    """Distance between the tip and the desired tip, (n, 1) in mm."""
    actual = shaft_tip(rows.table["q_rad"], rows.actuator)
    desired = shaft_tip(rows.table["q_ref_rad"], rows.actuator)
    return 1e3 * np.sqrt(np.sum((actual - desired) ** 2, axis=1))[:, None]


TIP_DISTANCE = Quantity(
    "tip_distance_mm", "mm", "distance of the shaft's tip from where it should be", values, 0.01
)
