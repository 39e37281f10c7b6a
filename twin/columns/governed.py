"""The reference that the law is handed, where a governor makes it."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from spheretwin.models.base.compiled import part_of_its_caller
from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.twin.columns.column import Columns
from spheretwin.twin.scenario.sections import Scenario

SIGNALS = (
    Signal("q_governed_rad", "rad", 3, "desired hinge angles as the governor has them", ANGLES),
    Signal("qdot_governed_rad_s", "rad/s", 3, "desired hinge rates as the governor has them", ANGLES),
    Signal(
        "qddot_governed_rad_s2", "rad/s²", 3, "desired accelerations as the governor has them, held", ANGLES
    ),
)


@part_of_its_caller
def write(row: NDArray, controller: Any, sensors: Any, plant: Any) -> None:
    """Write the columns of one tick."""
    motion = controller.around.governor.motion
    for part in range(3):
        for i in range(3):
            row[3 * part + i] = motion[part, i]


def _logged(scenario: Scenario) -> bool:
    return scenario.controller.governor.on


COLUMNS = Columns(lambda groups: SIGNALS, _logged, write)
