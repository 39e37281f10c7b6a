"""Heat of all coils together."""

from __future__ import annotations

import numpy as np

from spheretwin.viz.quantities.quantity import Array, Quantity, Rows


def values(rows: Rows) -> Array:
    """Copper loss, (n, 1) in W: as the amplifiers tell it, else by the resistance of cold coils."""
    table = rows.table
    if any(signal.name == "copper_loss_W" for signal in table.signals):
        return np.sum(table["copper_loss_W"], axis=1, keepdims=True)
    return rows.actuator.group.resistance_ohm * np.sum(table["current_A"] ** 2, axis=1, keepdims=True)


COPPER_LOSS = Quantity("copper_loss_total_W", "W", "heat of all coils", values, floor=0.5)
