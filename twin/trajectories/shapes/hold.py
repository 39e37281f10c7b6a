"""One pose."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spheretwin.twin.trajectories.trajectory import ZERO, Samples, Shape, Triple


class Hold(Shape):
    """One pose throughout: with another starting pose, a step response."""

    shape: Literal["hold"] = Field("hold", description="kind of trajectory")
    angle_rad: Triple = Field(ZERO, description="pose to hold, rad")

    def sharp(self, t: NDArray[np.float64]) -> Samples:  # noqa: D102
        samples = np.zeros((len(t), 3, 3))
        samples[:, 0] = self.angle_rad
        return samples
