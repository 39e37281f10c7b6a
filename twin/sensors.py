"""From the rotor's state to what the controller is handed."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import allocation_free


class Sensors(NamedTuple):
    """Angle sensors of the three hinges."""

    offset_rad: NDArray[np.float64]  # (3,)
    measured: NDArray[np.float64]  # (2, 3) what was handed over last: angles, rates; where not ideal
    ideal: bool


def sensors(offset_rad: tuple[float, float, float]) -> Sensors:
    """Sensors with a constant error of each angle, rad."""
    return Sensors(np.array(offset_rad), np.zeros((2, 3)), not any(offset_rad))


@allocation_free
def measure(
    sensors: Sensors,
    q: NDArray[np.float64],
    qdot: NDArray[np.float64],
    measurement: NDArray[np.float64],
) -> None:
    """Write measured angle (rad) and rate (rad/s) into the first rows of `measurement` (3, 3)."""
    for i in range(3):
        measurement[0, i], measurement[1, i] = q[i], qdot[i]
    if not sensors.ideal:
        for i in range(3):
            measurement[0, i] += sensors.offset_rad[i]
            sensors.measured[0, i], sensors.measured[1, i] = measurement[0, i], measurement[1, i]
