"""The kinds of numbers that parameters are made of: positive, not negative, one for each axis."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field

# Gains and times beyond this are slips of the pen; their products would overflow.
LARGEST = 1e9

NonNegative = Annotated[float, Field(ge=0, le=LARGEST)]
Positive = Annotated[float, Field(gt=0, le=LARGEST)]


def each(value: Any) -> Any:
    """One number for each of (alpha, beta, gamma) where only one is given for all."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return (value,) * 3
    return tuple(value) if isinstance(value, list) else value


NonNegativeEach = Annotated[tuple[NonNegative, NonNegative, NonNegative], BeforeValidator(each)]
PositiveEach = Annotated[tuple[Positive, Positive, Positive], BeforeValidator(each)]
