"""Tilt and return."""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spheretwin.twin.trajectories.rounding import Corners
from spheretwin.twin.trajectories.trajectory import LARGEST, Bounded, Samples, Shape


class Tilt(Shape):
    """Rise at a steady rate, hold, fall; the other hinges stay at 0 (60)."""

    shape: Literal["tilt"] = Field("tilt", description="kind of trajectory")
    rate_rad_s: Bounded = Field(np.pi / 30, description="rate of α while rising, rad/s")
    phase_s: Annotated[float, Field(gt=0, le=LARGEST)] = Field(
        2.0, description="length of rise, hold and fall each, s"
    )

    def sharp(self, t: NDArray[np.float64]) -> Samples:  # noqa: D102
        rising, falling = t < self.phase_s, (t >= 2 * self.phase_s) & (t < 3 * self.phase_s)
        samples = np.zeros((len(t), 3, 3))
        corners = self.phase_s * np.arange(4)
        samples[:, 0, 0] = np.interp(t, corners, self.rate_rad_s * self.phase_s * np.array([0, 1, 1, 0]))
        samples[:, 1, 0] = self.rate_rad_s * (rising.astype(float) - falling)
        return samples

    def corners(self) -> Corners:  # noqa: D102
        jumps = np.zeros((3, 3))
        jumps[:, 0] = self.rate_rad_s * np.array([-1, -1, 1])
        return Corners(self.phase_s * np.arange(1, 4, dtype=np.float64), np.zeros((3, 3)), jumps)
