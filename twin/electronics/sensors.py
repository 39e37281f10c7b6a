"""Sensors of the rotor: ideal, or the chain of sensor stages, under common functions.

As with the engines in `plant.plant_tick`, the loop is compiled only for the sensors that a run has.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
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
from spheretwin.models.base.compiled import implements, inlined


class IdealSensors(NamedTuple):
    """Sensors that return the true angles and rates."""

    rows: int  # of a measurement that the sensors write


@inlined
def _sense_ideal(sensors: Any, q: Any, qdot: Any, noise: Any, measurement: Any) -> bool:
    finite = True
    for i in range(3):
        measurement[0, i], measurement[1, i] = q[i], qdot[i]
        finite = finite and isfinite(q[i]) and isfinite(qdot[i])
    return finite


Sensors = IdealSensors | SensorChain

_SENSE: dict[type, Any] = {IdealSensors: _sense_ideal, SensorChain: chain.sense}


def build_sensors(section: SensorsSection, seed: int, faults: SensorFaults | None = None) -> Sensors:
    """Return the sensors of a section, with errors drawn from the seed, and with fault inputs if given."""
    return IdealSensors(2) if section.ideal and faults is None else sensor_chain(section, seed, faults)


def measure_again(sensors: Sensors, section: SensorsSection, q: NDArray, noise: NDArray) -> None:
    """Fill the stored values of new sensors: those that they would have had at the last tick.

    Parameters
    ----------
    sensors : Sensors
    section : SensorsSection
        Section of the sensors.
    q : (3,) array, rad
        Pose at the last tick; empty before the first one.
    noise : array
        Random numbers of the last tick.
    """
    if isinstance(sensors, SensorChain) and len(q):
        numbers = width_of(noise_streams(section))
        # Random numbers of sensors with another width do not apply to these.
        last_noise = noise if len(noise) == numbers else np.zeros(numbers)
        chain.sense(sensors, q, np.zeros(3), last_noise, np.empty((3, 3)))


def sense(sensors: Sensors, q: NDArray, qdot: NDArray, noise: NDArray, measurement: NDArray) -> bool:
    """Write measured angles and true rates into a measurement (3, 3), as in `sensor_chain.sense`."""
    return bool(_SENSE[type(sensors)](sensors, q, qdot, noise, measurement))


@inlined
def _write_nothing(sensors: Any, row: Any) -> None:
    pass


_WRITE_TELEMETRY: dict[type, Any] = {IdealSensors: _write_nothing, SensorChain: chain.write_telemetry}


def write_telemetry(sensors: Sensors, row: NDArray) -> None:
    """Write the states of the sensors (3,), rad; ideal sensors have none."""
    _WRITE_TELEMETRY[type(sensors)](sensors, row)


@implements(write_telemetry, inline=True)
def _compiled_write_telemetry(sensors: Any, row: Any) -> Callable[..., Any] | None:
    implementation: Any = _WRITE_TELEMETRY.get(getattr(sensors, "instance_class", object))

    def call(sensors: Any, row: Any) -> None:
        implementation(sensors, row)

    return call if implementation else None


@implements(sense, inline=True)
def _compiled_sense(
    sensors: Any, q: Any, qdot: Any, noise: Any, measurement: Any
) -> Callable[..., Any] | None:
    implementation: Any = _SENSE.get(getattr(sensors, "instance_class", object))

    def call(sensors: Any, q: Any, qdot: Any, noise: Any, measurement: Any) -> Any:
        return implementation(sensors, q, qdot, noise, measurement)

    return call if implementation else None
