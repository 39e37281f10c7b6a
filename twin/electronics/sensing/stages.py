"""One name for what comes between the joints and the controller: nothing, sensors, or sensors with faults.

As `plant.stepping` does for engines: the loop is compiled for one of them, and the others are not compiled.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from spheretwin.models.base.compiled import part_of_its_caller
from spheretwin.twin.electronics.sensing import chain, faulty
from spheretwin.twin.electronics.sensing.chain import Sensing
from spheretwin.twin.electronics.sensing.faulty import FaultySensing, SensorFaults
from spheretwin.twin.electronics.sensing.sections import SensorsSection


class Exact(NamedTuple):
    """Sensors that hand over the truth."""

    rows: int  # that they write of a measurement


@part_of_its_caller
def _exactly(sensing: Any, q: Any, qdot: Any, noise: Any, measurement: Any) -> bool:
    finite = True
    for i in range(3):
        measurement[0, i], measurement[1, i] = q[i], qdot[i]
        finite = finite and isfinite(q[i]) and isfinite(qdot[i])
    return finite


Sensors = Exact | Sensing | FaultySensing

_SENSE: dict[type, Any] = {Exact: _exactly, Sensing: chain.sense, FaultySensing: faulty.sense}


def made(section: SensorsSection, seed: int, faults: SensorFaults | None = None) -> Sensors:
    """What a section asks for, with the errors that the seed gives it, and the faults that may come."""
    if faults is not None:
        return FaultySensing(chain.sensing(section, seed), faults)
    return Exact(2) if section.ideal else chain.sensing(section, seed)


def state_of(sensing: Sensors) -> NDArray:
    """All that they go on from."""
    return faulty.state_of(sensing) if isinstance(sensing, FaultySensing) else np.empty(0)


def restore(sensing: Sensors, state: NDArray) -> None:
    """Go on from a state of sensors of the same size."""
    if isinstance(sensing, FaultySensing):
        faulty.restore(sensing, state)


def carried_on(before: Sensors, after: Sensors, q: NDArray, noise: NDArray) -> None:
    """Go on as before with other figures, from the pose (3,), rad, and the noise of the last tick; none yet.

    What may be held from now on is then what it would have been, had it been kept all the time.
    """
    if not isinstance(after, FaultySensing):
        return
    if isinstance(before, FaultySensing):
        faulty.carried_on(before, after)
    elif len(q):
        measurement = np.empty((3, 3))
        sense(before, q, np.zeros(3), noise, measurement)
        faulty.begun(after, q, measurement[0])


def sense(sensing: Sensors, q: NDArray, qdot: NDArray, noise: NDArray, measurement: NDArray) -> bool:
    """Write measured angles and true rates into a measurement (3, 3), as `chain.sense` does."""
    return bool(_SENSE[type(sensing)](sensing, q, qdot, noise, measurement))


@overload(sense, inline="always")
def _compiled_sense(
    sensing: Any, q: Any, qdot: Any, noise: Any, measurement: Any
) -> Callable[..., Any] | None:
    chosen: Any = _SENSE.get(getattr(sensing, "instance_class", object))

    def call(sensing: Any, q: Any, qdot: Any, noise: Any, measurement: Any) -> Any:
        return chosen(sensing, q, qdot, noise, measurement)

    return call if chosen else None
