"""Friction on the hinges, where they have any."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from spheretwin.models.base.compiled import part_of_its_caller
from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.twin.columns.column import Columns
from spheretwin.twin.scenario.sections import Scenario

SIGNALS = (
    Signal("friction_Nm", "N·m", 3, "friction on the hinges, over the physics step that begins now", ANGLES),
)


@part_of_its_caller
def write(row: NDArray, controller: Any, sensors: Any, plant: Any) -> None:
    """Write the columns of one tick."""
    for i in range(3):
        row[i] = plant.first_friction_q[i]


def _logged(scenario: Scenario) -> bool:
    return any(scenario.plant.coulomb_Nm) or any(scenario.plant.viscous_Nm_s)


COLUMNS = Columns(lambda groups: SIGNALS, _logged, write)
