"""Values drawn from a normal distribution, cut off where they would be tolerances no part has."""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spheretwin.twin.study.axes.axis import LARGEST, DrawnAxis, Number


class Normal(DrawnAxis):
    """Normal, cut off at some standard deviations: what lies beyond is not drawn, and piles up nowhere."""

    kind: Literal["normal"] = Field("normal", description="how the values are chosen")
    mean: Number = Field(description="mean")
    deviation: Annotated[float, Field(gt=0, le=LARGEST)] = Field(description="standard deviation, uncut")
    most_deviations: Annotated[float, Field(gt=0, le=8)] = Field(
        3.0, description="where it is cut off, in standard deviations"
    )

    def drawn(self, uniform: NDArray[np.float64]) -> NDArray[np.float64]:
        """By the inverse of its distribution."""
        from scipy.special import ndtr, ndtri  # slow to import

        least = ndtr(-self.most_deviations)
        return self.mean + self.deviation * ndtri(least + (1 - 2 * least) * uniform)
