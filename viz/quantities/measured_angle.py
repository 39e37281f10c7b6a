"""How far what the controller takes for the hinge angles is from the truth."""

from __future__ import annotations

from spheretwin.viz.quantities.quantity import Array, Rows, by_axis


def values(rows: Rows) -> Array:
    """Measured minus true angles, (n, 3) in mrad."""
    return 1e3 * (rows.table["q_measured_rad"] - rows.table["q_rad"])


MEASURED_ANGLE = by_axis(
    "measurement_error_mrad", "mrad", "measured minus true angles", values, 0.1, needs="q_measured_rad"
)
