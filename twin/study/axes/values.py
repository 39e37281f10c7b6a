"""Values as they are listed: numbers, names, lists, whole faults."""

from typing import Annotated, Any, Literal

from pydantic import Field, JsonValue

from spheretwin.twin.study.axes.axis import MOST_VALUES, ListedAxis


class Values(ListedAxis):
    """Listed."""

    kind: Literal["values"] = Field("values", description="how the values are chosen")
    values: Annotated[tuple[JsonValue, ...], Field(min_length=1, max_length=MOST_VALUES)] = Field(
        description="the values, one after the other"
    )

    def listed(self) -> list[Any]:
        """As they are."""
        return list(self.values)
