"""Values at equal distances."""

from typing import Any, Literal

import numpy as np
from pydantic import Field

from spheretwin.twin.study.axes.axis import Count, ListedAxis, Number


class Linspace(ListedAxis):
    """From one value to another, both included."""

    kind: Literal["linspace"] = Field("linspace", description="how the values are chosen")
    first: Number = Field(description="first value")
    last: Number = Field(description="last value")
    count: Count = Field(description="how many")

    def listed(self) -> list[Any]:
        """At equal distances."""
        return list(np.linspace(self.first, self.last, self.count).tolist())
