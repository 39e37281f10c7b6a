"""Parameters of laws: base class and types of numbers."""

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

# A law file, shipped or of a user, imports all of these from here.

COMPENSATORS = ("governor", "prediction", "feed_forward")
"""Sections of a controller that hold the compensators around its law."""

Level = Annotated[
    Literal["acceleration", "torque"],
    Field(description="quantity that (41) gives; acceleration is scaled by nominal inertia"),
]


def named(law: str) -> Any:
    """Return the field of a law's name."""
    meaning = "control law; FILE.py:NAME for a law of your own"
    return Field(law, description=meaning, json_schema_extra={"path": "code"})


class ControllerSection(BaseModel):
    """Controller section of a scenario, common to all laws."""

    source: ClassVar[str] = ""
    """Digest of the file of a user's law."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    law: str
    period_s: Annotated[float, Field(gt=0, le=10)] = Field(
        1e-3, description="control period, s; a whole number of physics steps"
    )
    check_bounds: bool = Field(
        False,
        description="compile the law with bounds checks, for debugging: a read or write outside its arrays"
        " then ends the run with an error; slower",
    )
    governor: GovernorSection = Field(
        GovernorSection(), description="limits the acceleration of the reference"
    )
    prediction: PredictionSection = Field(
        PredictionSection(), description="compensates the nominal delay in the inputs of the law"
    )
    feed_forward: FeedForwardSection = Field(
        FeedForwardSection(), description="adds torques of the nominal model to the law's"
    )

    @property
    def compensators(self) -> dict[str, Any]:
        """Sections of the compensators, by name."""
        return {name: getattr(self, name) for name in COMPENSATORS}

    def without_compensators(self) -> Self:
        """Return a copy with all compensators off."""
        return self.model_copy(update={name: type(self).model_fields[name].default for name in COMPENSATORS})


class LawParameters(ControllerSection):
    """Base class of the parameters of a law, each with its range and meaning.

    A subclass adds its own parameters and builds the law in `build`. A shipped law also sets its name in
    `law`.
    """

    @abstractmethod
    def build(self, known: NominalModel) -> Law:
        """Return a law with these parameters for the nominal model `known`."""


def torque_factor(level: str, known: NominalModel) -> NDArray[np.float64]:
    """Return the factor from the output of (41) to a torque on each axis, (3,)."""
    return known.inertia if level == "acceleration" else np.ones(3)
