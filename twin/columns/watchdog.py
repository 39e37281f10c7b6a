"""Why the watchdog has taken the currents away, where there is one."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from spheretwin.control.supervision.watchdog import REASONS
from spheretwin.models.base.compiled import part_of_its_caller
from spheretwin.models.telemetry.signals import Signal
from spheretwin.twin.columns.column import Columns

SIGNALS = (
    Signal(
        "failsafe_reason",
        "1",
        1,
        "why the watchdog has taken the currents away",
        states=tuple(reason.told for reason in REASONS.values()),
    ),
)


@part_of_its_caller
def write(row: NDArray, controller: Any, sensors: Any, plant: Any) -> None:
    """Write the columns of one tick."""
    row[0] = controller.supervision.watchdog.reason[0]


COLUMNS = Columns(lambda groups: SIGNALS, lambda scenario: scenario.watchdog.on, write)
