"""Values at equal ratios."""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from spheretwin.twin.study.axes.axis import LARGEST, Count, ListedAxis

Positive = Annotated[float, Field(gt=0, le=LARGEST)]


class Logspace(ListedAxis):
    """From one value to another, both included."""

    kind: Literal["logspace"] = Field("logspace", description="how the values are chosen")
    first: Positive = Field(description="first value, not its exponent")
    last: Positive = Field(description="last value")
    count: Count = Field(description="how many")

    def listed(self) -> list[Any]:
        """At equal ratios."""
        return list(np.geomspace(self.first, self.last, self.count).tolist())
