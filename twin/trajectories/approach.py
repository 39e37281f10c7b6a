"""The way to a shape from another motion: what tells the two apart at the start fades away.

Angles and rates fade by the polynomial of fifth degree that ends without angle, rate or acceleration; a
difference of accelerations fades by another, sooner, as it would else carry the motion far away.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from spheretwin.models.telemetry.series import LONGEST_s
from spheretwin.twin.trajectories.numbers import CONFIG, ZERO, Time, Triple

Array = NDArray[np.float64]

# Soon enough that 10 rad/s² of difference move the angle by 2 mrad.
SOON_s = 0.1

# Powers 1 to 5 of the share of the way, (3, 6): an angle, a rate and an acceleration of 1 at the start, each
# alone, and none of the three at the end.
FADING = np.array(
    [
        [1.0, 0.0, 0.0, -10.0, 15.0, -6.0],
        [0.0, 1.0, 0.0, -6.0, 8.0, -3.0],
        [0.0, 0.0, 0.5, -1.5, 1.5, -0.5],
    ]
)


class Approach(BaseModel):
    """From a stated motion to the shape; before it begins, the pose is held."""

    model_config = CONFIG

    start_s: Time = Field(0.0, description="time at which it begins, s")
    lasts_s: Annotated[float, Field(ge=1e-6, le=LONGEST_s)] = Field(
        1.0, description="how long it takes until the shape is followed, s"
    )
    angle_rad: Triple = Field(ZERO, description="pose at its beginning, rad")
    rate_rad_s: Triple = Field(ZERO, description="rates at its beginning, rad/s")
    acceleration_rad_s2: Triple = Field(ZERO, description="accelerations at its beginning, rad/s²")
    shape_s: Time = Field(0.0, description="time of the shape's own at its beginning, s")

    def join(self, shape: Callable[[Array], Array], t: Array) -> Array:
        """Motion at times `t` (s), as a shape's own: (n, 3, 3)."""
        since = t - self.start_s
        samples = shape(self.shape_s + np.maximum(since, 0.0))
        begun = np.array([self.angle_rad, self.rate_rad_s, self.acceleration_rad_s2])
        samples += faded(begun - shape(np.array([self.shape_s]))[0], np.maximum(since, 0.0), self.lasts_s)
        samples[since < 0] = [begun[0], np.zeros(3), np.zeros(3)]
        return samples


def faded(difference: Array, since: Array, lasts_s: float) -> Array:
    """What is left of a difference of two motions.

    Parameters
    ----------
    difference : (3, 3) array
        Angle, rate, acceleration as rows, at the start.
    since : (n,) array, s
        Times since then.
    lasts_s : float, s
        Time after which nothing is left.

    Returns
    -------
    (n, 3, 3) array
    """
    soon_s = min(lasts_s, SOON_s)
    return _faded(difference[:2], since, lasts_s, 0) + _faded(difference[2:], since, soon_s, 2)


def _faded(rows: Array, since: Array, lasts_s: float, first: int) -> Array:
    """The same of some rows that fade together, which begin with the derivative `first`."""
    share = np.minimum(since / lasts_s, 1.0)
    left = np.zeros((len(since), 3, 3))
    for order, row in enumerate(rows, first):
        polynomial = np.polynomial.Polynomial(FADING[order])
        for derivative in range(3):
            weight = polynomial.deriv(derivative)(share) * lasts_s ** (order - derivative)
            weight[share >= 1.0] = 0.0
            left[:, derivative] += weight[:, None] * row
    return left
