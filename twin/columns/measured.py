"""Measured angles and estimated rates, if they can differ from the truth."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from spheretwin.models.base.compiled import part_of_its_caller
from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.twin.columns.column import Columns
from spheretwin.twin.scenario.sections import Scenario

SIGNALS = (
    Signal("q_measured_rad", "rad", 3, "hinge angles as the controller has them", ANGLES),
    Signal("qdot_estimated_rad_s", "rad/s", 3, "hinge rates as the controller has them", ANGLES),
)


@part_of_its_caller
def write(row: NDArray, controller: Any, sensors: Any, plant: Any) -> None:
    """Write the columns of one tick."""
    for i in range(3):
        row[i], row[3 + i] = controller.pose[i], controller.rates[i]


def _logged(scenario: Scenario) -> bool:
    return not scenario.measures_truth


COLUMNS = Columns(lambda groups: SIGNALS, _logged, write)
