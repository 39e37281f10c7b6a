"""How far what the controller takes for the hinge rates is from the truth."""

from __future__ import annotations

from spheretwin.viz.quantities.quantity import Array, Rows, by_axis


def values(rows: Rows) -> Array:
    """Estimated minus true rates, (n, 3) in rad/s."""
    return rows.table["qdot_estimated_rad_s"] - rows.table["qdot_rad_s"]


ESTIMATED_RATE = by_axis(
    "rate_error_rad_s", "rad/s", "estimated minus true rates", values, 0.01, needs="qdot_estimated_rad_s"
)
