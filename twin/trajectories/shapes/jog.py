"""Steady rates, as by hand."""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spheretwin.twin.trajectories.rounding import Corners
from spheretwin.twin.trajectories.trajectory import LARGEST, ZERO, Bounded, Samples, Shape, Triple

Farthest = Annotated[float, Field(gt=0, le=LARGEST)]


class Jog(Shape):
    """Every hinge turns at a steady rate until α or β is as far from upright as it may go."""

    shape: Literal["jog"] = Field("jog", description="kind of trajectory")
    start_rad: Triple = Field(ZERO, description="pose at the start, rad")
    rate_rad_s: tuple[Bounded, Bounded, Bounded] = Field((0.0, 0.0, 0.5), description="rates, rad/s")
    farthest_rad: Farthest = Field(
        1.3, description="largest angle of α and β, rad; one that begins beyond it turns back alone"
    )

    def sharp(self, t: NDArray[np.float64]) -> Samples:  # noqa: D102
        samples = np.zeros((len(t), 3, 3))
        moving = t[:, None] < self._ends_s()
        samples[:, 0] = self.start_rad + np.array(self.rate_rad_s) * np.minimum(t[:, None], self._ends_s())
        samples[:, 1] = np.where(moving, self.rate_rad_s, 0.0)
        return samples

    def corners(self) -> Corners:  # noqa: D102
        ends = self._ends_s()
        axes = [axis for axis in np.argsort(ends, kind="stable") if 0 < ends[axis] < np.inf]
        jumps = np.zeros((len(axes), 3))
        jumps[np.arange(len(axes)), axes] = -np.array(self.rate_rad_s)[axes]
        return Corners(ends[axes], np.zeros_like(jumps), jumps)

    def _ends_s(self) -> NDArray[np.float64]:
        """Times (3,) at which the hinges stop; endless for γ, and for one that does not turn."""
        ends = np.full(3, np.inf)
        for axis in range(2):
            rate = self.rate_rad_s[axis]
            if rate != 0:
                ends[axis] = max(0.0, (self.farthest_rad - np.sign(rate) * self.start_rad[axis]) / abs(rate))
        return ends
