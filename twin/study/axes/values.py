"""Values as they are listed: numbers, names, lists, whole faults."""

from typing import Annotated, Any, Literal

from pydantic import Field, JsonValue, field_validator

from spheretwin.twin.study.axes.axis import MOST_VALUES, ListedAxis


class Values(ListedAxis):
    """Listed."""

    kind: Literal["values"] = Field("values", description="how the values are chosen")
    values: Annotated[tuple[JsonValue, ...], Field(max_length=MOST_VALUES)] = Field(
        description="the values, one after the other"
    )

    @field_validator("values")
    @classmethod
    def _not_none(cls, values: tuple[JsonValue, ...]) -> tuple[JsonValue, ...]:
        if not values:
            raise ValueError("expected one value at least, received none")
        return values

    def listed(self) -> list[Any]:
        """As they are."""
        return list(self.values)
