"""One name for what comes between the joints and the controller: nothing, or the chain of stages.

As `plant.stepping` does for engines: the loop is compiled for one of them, and the other is not compiled.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from spheretwin.electronics import sensor_chain as chain
from spheretwin.electronics.random_streams import width_of
from spheretwin.electronics.sensor_chain import (
    SensorChain,
    SensorFaults,
    SensorsSection,
    noise_streams,
    sensor_chain,
)
from spheretwin.models.base.compiled import part_of_its_caller


class IdealSensors(NamedTuple):
    """Sensors that hand over the truth."""

    rows: int  # that they write of a measurement


@part_of_its_caller
def _sense_ideal(sensors: Any, q: Any, qdot: Any, noise: Any, measurement: Any) -> bool:
    finite = True
    for i in range(3):
        measurement[0, i], measurement[1, i] = q[i], qdot[i]
        finite = finite and isfinite(q[i]) and isfinite(qdot[i])
    return finite


Sensors = IdealSensors | SensorChain

_SENSE: dict[type, Any] = {IdealSensors: _sense_ideal, SensorChain: chain.sense}


def build_sensors(section: SensorsSection, seed: int, faults: SensorFaults | None = None) -> Sensors:
    """Sensors of a section, with the errors that the seed gives them, and the faults that may come."""
    return IdealSensors(2) if section.ideal and faults is None else sensor_chain(section, seed, faults)


def transfer_sensors(
    before: Sensors, after: Sensors, section: SensorsSection, q: NDArray, noise: NDArray
) -> None:
    """Go on as before with other figures.

    Parameters
    ----------
    before, after : Sensors
    section : SensorsSection
        Of those after.
    q : (3,) array, rad
        Pose at the last tick; empty before the first one.
    noise : array
        Random numbers of the last tick.
    """
    if isinstance(after, SensorChain):
        if len(q):  # what is held from now on is what it would have been
            numbers = width_of(noise_streams(section))
            last = (
                noise if len(noise) == numbers else np.zeros(numbers)
            )  # those of other sensors are not its own
            chain.sense(after, q, np.zeros(3), last, np.empty((3, 3)))
        if isinstance(before, SensorChain):
            chain.transfer(before, after)


def sense(sensors: Sensors, q: NDArray, qdot: NDArray, noise: NDArray, measurement: NDArray) -> bool:
    """Write measured angles and true rates into a measurement (3, 3), as `chain.sense` does."""
    return bool(_SENSE[type(sensors)](sensors, q, qdot, noise, measurement))


@overload(sense, inline="always")
def _compiled_sense(
    sensors: Any, q: Any, qdot: Any, noise: Any, measurement: Any
) -> Callable[..., Any] | None:
    chosen: Any = _SENSE.get(getattr(sensors, "instance_class", object))

    def call(sensors: Any, q: Any, qdot: Any, noise: Any, measurement: Any) -> Any:
        return chosen(sensors, q, qdot, noise, measurement)

    return call if chosen else None
