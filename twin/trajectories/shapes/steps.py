"""Poses held one after another."""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spheretwin.models.telemetry.series import Series, check_rising, reached
from spheretwin.twin.trajectories.rounding import Corners
from spheretwin.twin.trajectories.trajectory import ZERO, Samples, Shape, Time, Triple


class Steps(Shape):
    """A pose, and others from stated times on; rates and accelerations are 0."""

    shape: Literal["steps"] = Field("steps", description="kind of trajectory")
    start_rad: Triple = Field(ZERO, description="pose before the first step, rad")
    times_s: Annotated[tuple[Time, ...], Field(min_length=1)] = Field(
        (1.0,), description="times of the steps, rising, s"
    )
    angles_rad: tuple[Triple, ...] = Field(
        ((0.2, -0.1, 0.3),), description="pose from each of these times on, rad"
    )

    def sharp(self, t: NDArray[np.float64]) -> Samples:  # noqa: D102
        samples = np.zeros((len(t), 3, 3))
        samples[:, 0] = Series(np.array(self.times_s), np.array(self.angles_rad)).held(t, self.start_rad)
        return samples

    def corners(self) -> Corners:  # noqa: D102
        jumps = np.diff(np.array([self.start_rad, *self.angles_rad]), axis=0)
        return Corners(reached(np.array(self.times_s)), jumps, np.zeros_like(jumps))

    def _check(self) -> None:
        if len(self.times_s) != len(self.angles_rad):
            raise ValueError(
                f"expected as many angles_rad as times_s, received {len(self.angles_rad)}"
                f" for {len(self.times_s)} times"
            )
        check_rising(self.times_s)
