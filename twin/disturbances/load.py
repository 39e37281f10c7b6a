"""Load and random torque, taken off the control torque: ``tau_d = tau_l + tau_r`` (1), (55), (56)."""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

LOAD_UNIT_Nm = 0.05  # paper: torque of L = 1 on each axis

# A hundred times what the coils can hold; beyond it only the engine's range is tested.
LARGEST_LOAD = 1000.0


class Disturbance(BaseModel):
    """What acts on the hinges beside the coils."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    load: Annotated[float, Field(ge=-LARGEST_LOAD, le=LARGEST_LOAD)] = Field(
        0.0, description="L, constant load in units of 0.05 N·m on each axis"
    )
    random_bound_Nm: Annotated[float, Field(ge=0, le=LARGEST_LOAD)] = Field(
        0.0, description="bound of the uniform random factor r, N·m (paper: 0.05)"
    )
    gamma_envelope: Literal["decaying", "growing"] = Field(
        "decaying", description="exp(-πt) or, as printed, exp(πt) on the third axis"
    )

    def sample(self, t: NDArray[np.float64], draws: NDArray[np.float64]) -> NDArray[np.float64]:
        """Disturbance at the control ticks, each held for a control period.

        Parameters
        ----------
        t : (n,) array, s
            Times of the ticks.
        draws : (n,) array
            Uniform random numbers from 0 to 1, one a tick, that r is made of.

        Returns
        -------
        (n, 3) array, N·m
            Generalised torque, subtracted in (1); not finite where the growing envelope overflows.
        """
        r = -self.random_bound_Nm + 2 * self.random_bound_Nm * draws
        growth = np.pi if self.gamma_envelope == "growing" else -np.pi
        with np.errstate(over="ignore"):
            third = np.exp(growth * t) if self.random_bound_Nm else np.zeros_like(t)
        envelope = np.stack([np.cos(np.pi * t), np.sin(-np.pi * t), third], axis=1)
        return self.load * LOAD_UNIT_Nm + r[:, None] * envelope  # (n, 3)
