"""The torque that is fed forward, where any is."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from spheretwin.models.base.compiled import part_of_its_caller
from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.twin.columns.column import Columns
from spheretwin.twin.scenario.sections import Scenario

SIGNALS = (
    Signal("feed_forward_Nm", "N·m", 3, "part of torque_command_Nm that is fed forward, generalised", ANGLES),
)


@part_of_its_caller
def write(row: NDArray, controller: Any, sensors: Any, plant: Any) -> None:
    """Write the columns of one tick."""
    for i in range(3):
        row[i] = controller.around.feed.torque_q[i]


def _logged(scenario: Scenario) -> bool:
    return scenario.controller.feed_forward.on


COLUMNS = Columns(lambda groups: SIGNALS, _logged, write)
