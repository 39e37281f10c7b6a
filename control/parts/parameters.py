"""Parameters of laws: the base of every law's own, and the kinds of numbers they are made of."""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from spheretwin.control.law import Known, Law

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

Level = Annotated[
    Literal["acceleration", "torque"],
    Field(description="what (41) is read as; acceleration is scaled by nominal inertia"),
]


def named(law: str) -> Any:
    """Field of a law's name."""
    meaning = "control law; FILE.py:NAME for one of your own"
    return Field(law, description=meaning, json_schema_extra={"path": "code"})


class ControllerSection(BaseModel):
    """What a scenario says of its controller, whatever law runs."""

    source: ClassVar[str] = ""
    """Digest of the file of one of the user's."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    law: str
    period_s: Annotated[float, Field(gt=0, le=10)] = Field(
        1e-3, description="control period, s; a whole number of physics steps"
    )


class LawParameters(ControllerSection):
    """Parameters that every law has; each law's own add to them, each with its range and meaning.

    A subclass makes the law in `build`, and a shipped one names itself in `law`. That is all that a law is,
    here or in a file of its user's.
    """

    @abstractmethod
    def build(self, known: Known) -> Law:
        """Law with these parameters, for what is known of the rotor."""


def torque_factor(level: str, known: Known) -> NDArray[np.float64]:
    """Factor from the output of (41) to a torque on each axis, (3,)."""
    return known.inertia if level == "acceleration" else np.ones(3)
