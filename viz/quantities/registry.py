"""All derived quantities: one row each."""

from __future__ import annotations

from collections.abc import Collection

from spheretwin.viz.quantities.copper_loss import COPPER_LOSS
from spheretwin.viz.quantities.coupling import COUPLING
from spheretwin.viz.quantities.delivered import DELIVERED
from spheretwin.viz.quantities.error import ERROR
from spheretwin.viz.quantities.error_angle import ERROR_ANGLE
from spheretwin.viz.quantities.estimated_rate import ESTIMATED_RATE
from spheretwin.viz.quantities.margin import MARGIN
from spheretwin.viz.quantities.measured_angle import MEASURED_ANGLE
from spheretwin.viz.quantities.quantity import Quantity
from spheretwin.viz.quantities.tip_distance import TIP_DISTANCE

QUANTITIES: tuple[Quantity, ...] = (
    ERROR,
    ERROR_ANGLE,
    TIP_DISTANCE,
    DELIVERED,
    MARGIN,
    COUPLING,
    COPPER_LOSS,
    MEASURED_ANGLE,
    ESTIMATED_RATE,
)


def quantities_of(names: Collection[str]) -> tuple[Quantity, ...]:
    """Those that a run with signals of these names has."""
    return tuple(quantity for quantity in QUANTITIES if not quantity.needs or quantity.needs in names)
