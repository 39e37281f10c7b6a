"""What an axis is: a field, and its values, listed or drawn."""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

# A grid beyond this is a slip of the pen: at a millisecond a row it would take weeks.
MOST_VALUES = 1_000_000

LARGEST = 1e9

Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Count = Annotated[int, Field(ge=1, le=MOST_VALUES)]


class Axis(BaseModel):
    """A field that differs from row to row.

    A kind of which every value is known says them in `listed`; one that is drawn turns uniform numbers from
    0 to 1 into values in `drawn`.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    kind: str
    field: Annotated[str, Field(min_length=1)] = Field(
        description="dotted name of the field; with a place behind it, an entry of a list"
    )
    zip: str | None = Field(
        None, description="axes of the same name go together, value by value; all others are crossed"
    )

    @property
    def is_drawn(self) -> bool:
        """Whether its values are drawn."""
        return False


class ListedAxis(Axis):
    """An axis of which every value is known."""

    @abstractmethod
    def listed(self) -> list[Any]:
        """Its values."""


class DrawnAxis(Axis):
    """An axis whose values are drawn."""

    @property
    def is_drawn(self) -> bool:
        """It is."""
        return True

    @abstractmethod
    def drawn(self, uniform: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values (n,) of uniform numbers (n,), above 0 and below 1."""
