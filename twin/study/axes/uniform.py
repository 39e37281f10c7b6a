"""Values drawn evenly between two bounds."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from spheretwin.twin.study.axes.axis import DrawnAxis, Number


class Uniform(DrawnAxis):
    """Evenly between two bounds."""

    kind: Literal["uniform"] = Field("uniform", description="how the values are chosen")
    low: Number = Field(description="lower bound")
    high: Number = Field(description="upper bound")

    @model_validator(mode="after")
    def _in_order(self) -> "Uniform":
        if not self.low < self.high:
            raise ValueError(f"expected low below high, received {self.low!r} and {self.high!r}")
        return self

    def drawn(self, uniform: NDArray[np.float64]) -> NDArray[np.float64]:
        """By the inverse of its distribution."""
        return self.low + (self.high - self.low) * uniform
