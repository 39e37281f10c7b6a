"""Gains of the compared laws, and the one layout in which the compiled laws receive them."""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

# Gains and times beyond this are slips of the pen; their products would overflow.
LARGEST = 1e9

NonNegative = Annotated[float, Field(ge=0, le=LARGEST)]
Positive = Annotated[float, Field(gt=0, le=LARGEST)]

# Layout of the packed gains.
PERIOD, SURFACE_SLOPE, REACHING_GAIN, FUZZY_RATE, SWITCHING_RATE, BOUND_RATE = range(6)
INERTIA = 6  # and the two that follow


class Gains(BaseModel):
    """Gains of the paper, the same on each axis (58)."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    law: Literal["pd", "adaptive_fuzzy", "afsm"] = Field("afsm", description="control law")
    level: Literal["acceleration", "torque"] = Field(
        "acceleration", description="what (41) is read as; acceleration is scaled by nominal inertia"
    )
    surface_slope: Positive = Field(50.0, description="λ of s = λe + ė, 1/s; PD: stiffness")
    reaching_gain: NonNegative = Field(20.0, description="K of the reaching term K s, 1/s; PD: damping")
    fuzzy_rate: NonNegative = Field(10.0, description="η, adaptation rate of the fuzzy consequents")
    switching_rate: NonNegative = Field(10.0, description="σ, growth rate of the switching gain ξ̂")
    bound_rate: NonNegative = Field(10.0, description="ς, growth rate of the coupling bound ζ̂")

    def pack(self, period: float, inertia: NDArray[np.float64]) -> NDArray[np.float64]:
        """Gains as the compiled laws read them.

        Parameters
        ----------
        period : float, s
            Control period, over which the estimates are integrated.
        inertia : (3,) array, kg·m²
            Nominal principal inertias.

        Returns
        -------
        (9,) array
            Period, gains, and the factor from the law's output to torque on each axis.
        """
        factor = inertia if self.level == "acceleration" else np.ones(3)
        gains = [self.surface_slope, self.reaching_gain, self.fuzzy_rate]
        return np.array([period, *gains, self.switching_rate, self.bound_rate, *factor])
