"""A sum of sines."""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from spheretwin.twin.trajectories.trajectory import CONFIG, LARGEST, ZERO, Samples, Shape, Triple

Frequency = Annotated[float, Field(ge=0, le=LARGEST)]


class Component(BaseModel):
    """One sine of each axis: ``amplitude sin(2 pi f t + phase)``."""

    model_config = CONFIG

    amplitude_rad: Triple = Field((0.1, 0.1, 0.1), description="amplitude on each axis, rad")
    frequency_Hz: tuple[Frequency, Frequency, Frequency] = Field(
        (0.5, 0.5, 0.5), description="frequency on each axis, Hz"
    )
    phase_rad: Triple = Field(ZERO, description="phase on each axis at 0 s, rad")


class Multisine(Shape):
    """A pose and the sines about it; in a file, each is a table ``[[trajectory.components]]``."""

    shape: Literal["multisine"] = Field("multisine", description="kind of trajectory")
    offset_rad: Triple = Field(ZERO, description="pose that the sines go about, rad")
    components: Annotated[tuple[Component, ...], Field(min_length=1)] = Field(
        (Component(),), description="sines that add: amplitude_rad, frequency_Hz and phase_rad of each axis"
    )

    def sharp(self, t: NDArray[np.float64]) -> Samples:  # noqa: D102
        samples = np.zeros((len(t), 3, 3))
        samples[:, 0] = self.offset_rad
        for each in self.components:
            amplitude, w = np.array(each.amplitude_rad), 2 * np.pi * np.array(each.frequency_Hz)
            phase = t[:, None] * w + np.array(each.phase_rad)
            samples[:, 0] += amplitude * np.sin(phase)
            samples[:, 1] += amplitude * w * np.cos(phase)
            samples[:, 2] -= amplitude * w**2 * np.sin(phase)
        return samples
