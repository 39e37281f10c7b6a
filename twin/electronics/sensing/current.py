"""Sensors of the group currents, in the coils' own leads: what a detector of faults is handed.

A sensor in the amplifier would not see a shorted coil, which carries what is commanded past it.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from spheretwin.models.base.compiled import allocation_free
from spheretwin.twin.trajectories.trajectory import CONFIG


class CurrentSection(BaseModel):
    """Sensors of the group currents; ideal while they have no noise. Nothing but a detector reads them."""

    model_config = CONFIG

    noise_A: Annotated[float, Field(ge=0, le=1e3)] = Field(
        0.0, description="noise of a sample, A rms (assumed for the prototype: 0.02, a Hall sensor's)"
    )


@allocation_free
def sense_currents(
    noise_A: float,
    current: NDArray[np.float64],
    draws: NDArray[np.float64],
    first: int,
    measured: NDArray[np.float64],
) -> None:
    """Write the measured currents of a control tick.

    Parameters
    ----------
    noise_A : float, A
        Standard deviation.
    current : (n,) array, A
        True, at the tick.
    draws : array
        Standard normal numbers; n of them from `first` on are used, and none without noise.
    first : int
    measured : (n,) array, A
        Result.
    """
    for j in range(current.shape[0]):
        measured[j] = current[j]
        if noise_A > 0.0:
            measured[j] += noise_A * draws[first + j]
