"""Sensors of the group currents, in the coils' own leads: what a detector of faults is handed.

A sensor in the amplifier would not see a shorted coil, which carries what is commanded past it.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from spheretwin.models.base.compiled import allocation_free
from spheretwin.twin.trajectories.trajectory import CONFIG


class CurrentSection(BaseModel):
    """Sensors of the group currents; a detector of faults reads them, and the telemetry has what they say.

    There are such sensors if they have noise, or if a detector needs them.
    """

    model_config = CONFIG

    noise_A: Annotated[float, Field(ge=0, le=1e3)] = Field(
        0.0, description="noise of a sample, A rms (assumed for the prototype: 0.02, a Hall sensor's)"
    )


class CurrentSensors(NamedTuple):
    """Sensors of the group currents, for compiled code."""

    on: bool
    noise_A: float  # standard deviation
    measured_A: NDArray[np.float64]  # (n,) at the last control tick


@allocation_free
def sense_currents(sensors: CurrentSensors, current: NDArray[np.float64], draws: NDArray[np.float64]) -> None:
    """Measure the currents at a control tick.

    Parameters
    ----------
    sensors : CurrentSensors
        The measured currents are written.
    current : (n,) array, A
        True.
    draws : array
        Standard normal numbers, of which the last n are used; none without noise.
    """
    groups, measured = current.shape[0], sensors.measured_A
    first = draws.shape[0] - groups
    for j in range(groups):
        measured[j] = current[j]
        if sensors.noise_A > 0.0:
            measured[j] += sensors.noise_A * draws[first + j]
