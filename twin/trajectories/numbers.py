"""The kinds of numbers that trajectories are made of."""

from typing import Annotated

from pydantic import ConfigDict, Field

from spheretwin.models.telemetry.series import LONGEST_s

CONFIG = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

# Far beyond any motion of the actuator, and far from where squares of numbers overflow.
LARGEST = 1e4

Bounded = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Triple = tuple[Bounded, Bounded, Bounded]
Time = Annotated[float, Field(ge=0, le=LONGEST_s)]

ZERO: Triple = (0.0, 0.0, 0.0)
