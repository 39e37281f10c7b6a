"""How much of the commanded torque the current limit would still let be added to it."""

from __future__ import annotations

import numpy as np

from spheretwin.viz.quantities.quantity import Array, Kept, Quantity, Rows

MOST = 3.0
"""What is more is drawn as this: it matters to no one, and has no bound where hardly any torque is asked."""


def values(rows: Rows) -> Array:
    """Share of the commanded torque that could be added along itself, (n, 1); 0 where the limit acts."""
    largest_A = np.max(np.abs(rows.table["current_command_A"]), axis=1)
    factor = rows.current_limit_A / np.maximum(largest_A, rows.current_limit_A / (1 + MOST))
    left = np.where(rows.table["allocation_scale"] < 1, 0.0, np.maximum(factor - 1, 0.0))
    return left[:, None]


MARGIN = Quantity(
    "torque_margin",
    "1",
    "share of the commanded torque that the current limit would let be added",
    values,
    floor=MOST / 2,
    kept=Kept.LEAST,
)
