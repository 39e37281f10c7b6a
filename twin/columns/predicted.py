"""The motion that the law is handed, where that is predicted."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from spheretwin.models.base.compiled import part_of_its_caller
from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.twin.columns.column import Columns
from spheretwin.twin.scenario.sections import Scenario

SIGNALS = (
    Signal("q_predicted_rad", "rad", 3, "hinge angles predicted over the known delay", ANGLES),
    Signal("qdot_predicted_rad_s", "rad/s", 3, "hinge rates predicted over the known delay", ANGLES),
)


@part_of_its_caller
def write(row: NDArray, controller: Any, sensors: Any, plant: Any) -> None:
    """Write the columns of one tick."""
    prediction = controller.around.prediction
    for i in range(3):
        row[i], row[3 + i] = prediction.pose[i], prediction.rates[i]


def _logged(scenario: Scenario) -> bool:
    return scenario.controller.prediction.on


COLUMNS = Columns(lambda groups: SIGNALS, _logged, write)
