"""A torque that stays."""

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spheretwin.twin.disturbances.term import ZERO, Term, Torques


class Constant(Term):
    """The same torque throughout."""

    kind: Literal["constant"] = Field("constant", description="kind of disturbance")
    torque_Nm: Torques = Field(ZERO, description="torque on each axis, N·m")

    def sample(  # noqa: D102
        self, t: NDArray[np.float64], draws: Callable[[], NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        return np.tile(self.torque_Nm, (len(t), 1))
