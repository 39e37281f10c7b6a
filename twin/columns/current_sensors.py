"""Measured group currents, if there are sensors of them."""

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
    return (Signal("current_measured_A", "A", groups, "group currents as measured at the tick", each),)


@part_of_its_caller
def write(row: NDArray, controller: Any, sensors: Any, plant: Any) -> None:
    """Write the columns of one tick."""
    measured_A = plant.current_sensors.measured_A
    for j in range(measured_A.shape[0]):
        row[j] = measured_A[j]


COLUMNS = Columns(signals, lambda scenario: scenario.senses_currents, write)
