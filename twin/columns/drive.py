"""What amplifiers and coils do, where the amplifiers have a supply."""

from __future__ import annotations

from functools import cache
from typing import Any

from numpy.typing import NDArray

from spheretwin.models.base.compiled import part_of_its_caller
from spheretwin.models.telemetry.signals import Signal
from spheretwin.twin.columns.column import Columns


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
def write(row: NDArray, controller: Any, sensors: Any, plant: Any) -> None:  # noqa: D103
    driving, groups = plant.driving, plant.current.shape[0]
    flow, period_s = driving.flow, driving.coil.period_s
    row[0] = driving.supply_V * driving.drawn_As[0] / period_s
    for j in range(groups):
        row[1 + j] = flow.work_J[j] / period_s
        row[1 + groups + j] = flow.copper_J[j] / period_s
        row[1 + 2 * groups + j] = driving.coil.temperature_degC[j]
        row[1 + 3 * groups + j] = flow.voltage_limited_s[j] / period_s
        row[1 + 4 * groups + j] = flow.current_limited_s[j] / period_s


COLUMNS = Columns(signals, lambda scenario: scenario.drive.supply_V is not None, write)
