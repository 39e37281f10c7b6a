"""A torque that changes at stated times."""

from collections.abc import Callable
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from spheretwin.models.telemetry.series import Series, check_rising
from spheretwin.twin.disturbances.term import ZERO, Term, Time, Torques


class Steps(Term):
    """No torque, and others from stated times on."""

    kind: Literal["steps"] = Field("steps", description="kind of disturbance")
    times_s: Annotated[tuple[Time, ...], Field(min_length=1)] = Field(
        (1.0,), description="times of the steps, rising, s"
    )
    torques_Nm: tuple[Torques, ...] = Field(
        (ZERO,), description="torque on each axis from each of these times on, N·m"
    )

    def sample(  # noqa: D102
        self, t: NDArray[np.float64], draws: Callable[[], NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        return Series(np.array(self.times_s), np.array(self.torques_Nm)).held(t, ZERO)

    @model_validator(mode="after")
    def _usable(self) -> "Steps":
        if len(self.times_s) != len(self.torques_Nm):
            raise ValueError(
                f"expected as many torques_Nm as times_s, received {len(self.torques_Nm)}"
                f" for {len(self.times_s)} times"
            )
        check_rising(self.times_s)
        return self
