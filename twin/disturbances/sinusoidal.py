"""A torque that swings."""

from collections.abc import Callable
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spheretwin.twin.disturbances.term import ZERO, Term, Torques

# Far above what a control period can follow.
LARGEST_Hz, LARGEST_rad = 1e6, 1e4

Frequency = Annotated[float, Field(ge=0, le=LARGEST_Hz)]
Phase = Annotated[float, Field(ge=-LARGEST_rad, le=LARGEST_rad)]


class Sinusoidal(Term):
    """``amplitude sin(2 pi f t + phase)`` on each axis."""

    kind: Literal["sinusoidal"] = Field("sinusoidal", description="kind of disturbance")
    amplitude_Nm: Torques = Field(ZERO, description="amplitude on each axis, N·m")
    frequency_Hz: tuple[Frequency, Frequency, Frequency] = Field(
        (1.0, 1.0, 1.0), description="frequency on each axis, Hz"
    )
    phase_rad: tuple[Phase, Phase, Phase] = Field(
        (0.0, 0.0, 0.0), description="phase on each axis at 0 s, rad"
    )

    def sample(  # noqa: D102
        self, t: NDArray[np.float64], draws: Callable[[], NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        w = 2 * np.pi * np.array(self.frequency_Hz)
        swing: NDArray[np.float64] = np.sin(t[:, None] * w + np.array(self.phase_rad))
        return np.array(self.amplitude_Nm) * swing
