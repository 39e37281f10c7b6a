"""Parameters of laws: the base of every law's own, and the kinds of numbers they are made of."""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.control.compensators.feed_forward import FeedForwardSection
from spheretwin.control.compensators.prediction import PredictionSection
from spheretwin.control.compensators.reference_governor import GovernorSection
from spheretwin.control.law import LARGEST as LARGEST
from spheretwin.control.law import Law, NominalModel
from spheretwin.control.law import NonNegative as NonNegative
from spheretwin.control.law import NonNegativeEach as NonNegativeEach
from spheretwin.control.law import Positive as Positive
from spheretwin.control.law import PositiveEach as PositiveEach
from spheretwin.control.law import each as each

# The file of a law, shipped or its user's, finds here all that it needs of these.

COMPENSATORS = ("governor", "prediction", "feed_forward")
"""Sections of a controller that stand around its law."""

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
    check_bounds: bool = Field(
        False,
        description="compile the law with bounds checks: one that reads or writes outside its arrays then"
        " ends the run with an error; to debug, it is slower",
    )
    governor: GovernorSection = Field(
        GovernorSection(), description="bounds the acceleration of the reference"
    )
    prediction: PredictionSection = Field(
        PredictionSection(), description="takes the known delay out of what the law is handed"
    )
    feed_forward: FeedForwardSection = Field(
        FeedForwardSection(), description="adds torques of the nominal model to the law's"
    )

    @property
    def compensators(self) -> dict[str, Any]:
        """Sections of what stands around the law, by name."""
        return {name: getattr(self, name) for name in COMPENSATORS}

    def without_compensators(self) -> Self:
        """The same with nothing around the law."""
        return self.model_copy(update={name: type(self).model_fields[name].default for name in COMPENSATORS})


class LawParameters(ControllerSection):
    """Parameters that every law has; each law's own add to them, each with its range and meaning.

    A subclass makes the law in `build`, and a shipped one names itself in `law`. That is all that a law is,
    here or in a file of its user's.
    """

    @abstractmethod
    def build(self, known: NominalModel) -> Law:
        """Law with these parameters, for what is known of the rotor."""


def torque_factor(level: str, known: NominalModel) -> NDArray[np.float64]:
    """Factor from the output of (41) to a torque on each axis, (3,)."""
    return known.inertia if level == "acceleration" else np.ones(3)
