"""Axis of a study: a field, and its values, listed or random."""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, JsonValue, field_validator, model_validator

from spheretwin.models.base.errors import InputError

# A larger number is a mistake: at a millisecond a row it would take weeks.
MOST_VALUES = 1_000_000

LARGEST = 1e9

Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Count = Annotated[int, Field(ge=1, le=MOST_VALUES)]


class Axis(BaseModel):
    """A field that differs from row to row.

    A listed axis returns its values from `listed`; a random axis turns uniform numbers from 0 to 1 into
    values in `quantile`.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    kind: str
    field: Annotated[str, Field(min_length=1)] = Field(
        description="dotted name of the field; with an index behind it, an entry of a list"
    )
    zip: str | None = Field(
        None, description="axes of the same name go together, value by value; all others are crossed"
    )
    relative: bool = Field(
        False,
        exclude=True,
        description="whether the values are factors of the field's own value: from 0.9 to 1.1 is ±10 %",
    )

    @abstractmethod
    def scaled(self, own: float) -> Axis:
        """Return the axis with factors of a value in place of values, no longer relative."""

    def _with(self, **numbers: Any) -> Axis:
        return type(self).model_validate(self.model_dump() | numbers)


class ListedAxis(Axis):
    """Axis with listed values."""

    @abstractmethod
    def listed(self) -> list[Any]:
        """Values of the axis."""


class DrawnAxis(Axis):
    """Axis with random values."""

    @abstractmethod
    def quantile(self, uniform: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values (n,) of uniform numbers (n,), above 0 and below 1."""


class Linspace(ListedAxis):
    """Values from one to another, both included."""

    kind: Literal["linspace"] = Field("linspace", description="choice of the values")
    first: Number = Field(description="first value")
    last: Number = Field(description="last value")
    count: Count = Field(description="number of values")

    def listed(self) -> list[Any]:
        """Values at equal distances."""
        return list(np.linspace(self.first, self.last, self.count).tolist())

    def scaled(self, own: float) -> Axis:
        """Both ends times a value."""
        return self._with(first=own * self.first, last=own * self.last)


Positive = Annotated[float, Field(gt=0, le=LARGEST)]


class Logspace(ListedAxis):
    """Values from one to another, both included."""

    kind: Literal["logspace"] = Field("logspace", description="choice of the values")
    first: Positive = Field(description="first value, not its exponent")
    last: Positive = Field(description="last value")
    count: Count = Field(description="number of values")

    def listed(self) -> list[Any]:
        """Values at equal ratios."""
        return list(np.geomspace(self.first, self.last, self.count).tolist())

    def scaled(self, own: float) -> Axis:
        """Both ends times a value."""
        return self._with(first=own * self.first, last=own * self.last)


class Normal(DrawnAxis):
    """Normal distribution, truncated at some standard deviations."""

    kind: Literal["normal"] = Field("normal", description="choice of the values")
    mean: Number = Field(description="mean")
    deviation: Annotated[float, Field(gt=0, le=LARGEST)] = Field(
        description="standard deviation before truncation"
    )
    most_deviations: Annotated[float, Field(gt=0, le=8)] = Field(
        3.0, description="truncation, in standard deviations"
    )

    def quantile(self, uniform: NDArray[np.float64]) -> NDArray[np.float64]:
        """Inverse of the cumulative distribution."""
        from scipy.special import ndtr, ndtri  # slow to import

        least = ndtr(-self.most_deviations)
        return self.mean + self.deviation * ndtri(least + (1 - 2 * least) * uniform)

    def scaled(self, own: float) -> Axis:
        """Mean and deviation times a value."""
        return self._with(mean=own * self.mean, deviation=abs(own) * self.deviation)


class Uniform(DrawnAxis):
    """Uniform distribution between two bounds."""

    kind: Literal["uniform"] = Field("uniform", description="choice of the values")
    low: Number = Field(description="lower bound")
    high: Number = Field(description="upper bound")

    @model_validator(mode="after")
    def _in_order(self) -> Uniform:
        if not self.low < self.high:
            raise ValueError(f"expected low below high, received {self.low!r} and {self.high!r}")
        return self

    def quantile(self, uniform: NDArray[np.float64]) -> NDArray[np.float64]:
        """Inverse of the cumulative distribution."""
        return self.low + (self.high - self.low) * uniform

    def scaled(self, own: float) -> Axis:
        """Both bounds times a value."""
        low, high = sorted((own * self.low, own * self.high))
        return self._with(low=low, high=high)


class Values(ListedAxis):
    """Listed values."""

    kind: Literal["values"] = Field("values", description="choice of the values")
    values: Annotated[tuple[JsonValue, ...], Field(max_length=MOST_VALUES)] = Field(
        description="values in their order"
    )

    @field_validator("values")
    @classmethod
    def _not_none(cls, values: tuple[JsonValue, ...]) -> tuple[JsonValue, ...]:
        if not values:
            raise ValueError("expected one value at least, received none")
        return values

    def listed(self) -> list[Any]:
        """Given values."""
        return list(self.values)

    def scaled(self, own: float) -> Axis:
        """Numbers times a value."""
        numbers = [own * value for value in self.values if isinstance(value, int | float)]
        if len(numbers) < len(self.values):
            raise InputError(f"axis over {self.field}: expected numbers as factors, received {self.values!r}")
        return self._with(values=tuple(numbers))


AnyAxis = Annotated[
    Values  # one row each
    | Linspace
    | Logspace
    | Uniform
    | Normal,
    Field(discriminator="kind"),
]
