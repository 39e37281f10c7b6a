"""What amplifiers and coils do, where the amplifiers have a supply."""

from __future__ import annotations

from functools import cache
from typing import Any

from numpy.typing import NDArray

from spheretwin.models.base.compiled import part_of_its_caller
from spheretwin.models.telemetry.signals import Signal
from spheretwin.twin.columns.column import Columns
from spheretwin.twin.electronics.driving.stages import tell


@cache
def signals(groups: int) -> tuple[Signal, ...]:
    """Columns for a number of coil groups."""
    each = tuple(f"group {j}" for j in range(groups))
    return (
        Signal("supply_power_W", "W", 1, "drawn from the supply, mean over the control period"),
        Signal("coil_power_W", "W", groups, "at the ends of the coils, mean over the control period", each),
        Signal("copper_loss_W", "W", groups, "heat of the coils, mean over the control period", each),
        Signal("coil_temperature_degC", "°C", groups, "at the end of the control period", each),
        Signal("voltage_limited", "1", groups, "share of the period with the voltage at its limit", each),
        Signal("current_limited", "1", groups, "share of the period with the current at its limit", each),
    )


@part_of_its_caller
def write(row: NDArray, controller: Any, sensors: Any, plant: Any) -> None:
    """Write the columns of one tick."""
    tell(plant.driving, row)


COLUMNS = Columns(signals, lambda scenario: scenario.drive.supply_V is not None, write)
