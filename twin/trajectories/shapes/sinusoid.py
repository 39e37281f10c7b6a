"""A sine on each axis."""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spheretwin.twin.trajectories.trajectory import LARGEST, Samples, Shape, Triple


class Sinusoid(Shape):
    """``amplitude sin(2 pi f t)`` on each axis (paper section 4.1; its amplitude is not printed)."""

    shape: Literal["sinusoid"] = Field("sinusoid", description="kind of trajectory")
    amplitude_rad: Triple = Field((0.2, 0.2, 0.2), description="amplitude on each axis, rad")
    frequency_Hz: Annotated[float, Field(gt=0, le=LARGEST)] = Field(0.5, description="frequency, Hz")

    def sharp(self, t: NDArray[np.float64]) -> Samples:  # noqa: D102
        w = 2 * np.pi * self.frequency_Hz
        phase = (w * t)[:, None, None]
        rows = np.concatenate([np.sin(phase), w * np.cos(phase), -(w**2) * np.sin(phase)], axis=1)
        return rows * np.array(self.amplitude_rad)  # (n, 3, 3)
