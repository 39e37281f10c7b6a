"""All columns that not every run has, in the order of the telemetry: new ones are a file and a row."""

from __future__ import annotations

from typing import Any

from spheretwin.models.base.compiled import part_of_its_caller
from spheretwin.twin.columns import (
    current_sensors,
    drive,
    faults,
    fed,
    friction,
    governed,
    measured,
    predicted,
    watchdog,
)
from spheretwin.twin.columns.column import Columns

ALL: tuple[Columns, ...] = (
    measured.COLUMNS,
    current_sensors.COLUMNS,
    governed.COLUMNS,
    predicted.COLUMNS,
    fed.COLUMNS,
    friction.COLUMNS,
    drive.COLUMNS,
    faults.COLUMNS,
    watchdog.COLUMNS,
)


def _chained(columns: tuple[Columns, ...], place: int = 0) -> Any:
    """One compiled function that writes all columns that a run has, without a loop over functions."""
    if not columns:
        return _nothing
    write, others = columns[0].write, _chained(columns[1:], place + 1)

    @part_of_its_caller
    def write_and_go_on(row: Any, places: Any, controller: Any, sensors: Any, plant: Any) -> None:
        if places[place] >= 0:
            write(row[places[place] :], controller, sensors, plant)
        others(row, places, controller, sensors, plant)

    return write_and_go_on


@part_of_its_caller
def _nothing(row: Any, places: Any, controller: Any, sensors: Any, plant: Any) -> None:
    pass


write_columns = _chained(ALL)
"""``write_columns(row, places, controller, sensors, plant)``; a place below 0 is that of none."""
