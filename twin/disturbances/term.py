"""What a term of the disturbance is: a torque on the hinges by time, which adds to the others."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.models.telemetry.series import LONGEST_s

CONFIG = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

# Thousands of times what the coils can hold; beyond it only the engine's range is tested.
LARGEST_Nm = 1000.0

Torque = Annotated[float, Field(ge=-LARGEST_Nm, le=LARGEST_Nm)]
Torques = tuple[Torque, Torque, Torque]
Time = Annotated[float, Field(ge=0, le=LONGEST_s)]

ZERO: Torques = (0.0, 0.0, 0.0)


class Term(BaseModel):
    """A kind that a scenario can name: its parameters, and the torque that they make."""

    model_config = CONFIG

    @abstractmethod
    def sample(self, t: NDArray[np.float64], draws: Callable[[], NDArray[np.float64]]) -> NDArray[np.float64]:
        """Torque at control ticks, each held for a control period.

        Parameters
        ----------
        t : (n,) array, s
            Times of the ticks.
        draws : callable
            Gives the term's own random numbers at these ticks, (n,) from 0 to 1.

        Returns
        -------
        (n, 3) array, N·m
            Generalised torque on (α, β, γ), subtracted in (1).
        """
