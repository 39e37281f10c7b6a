"""Tracking error of each hinge, in a unit in which it can be read."""

from __future__ import annotations

from spheretwin.viz.quantities.quantity import Array, Rows, by_axis


def values(rows: Rows) -> Array:
    """Error (28), (n, 3) in mrad."""
    return 1e3 * rows.table["error_rad"]


ERROR = by_axis("error_mrad", "mrad", "tracking error q - q_ref (28)", values, floor=0.1)
