"""What ``[optimise]`` of a study says: gains and their ranges, objectives, and how they are looked for."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from spheretwin.twin.metrics.registry import METRICS

CONFIG = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

MOST_TRIALS = 100_000
MOST_FRESH = 1000

HINGES = ("alpha", "beta", "gamma")

Name = Annotated[str, Field(min_length=1, max_length=100)]


class Setting(BaseModel):
    """A field that a gain sets: ``factor gain^power``; where several gains set one field, their product."""

    model_config = CONFIG

    field: Name = Field(description="dotted name, as on a command line")
    factor: float = Field(1.0, description="what the power of the gain is multiplied by")
    power: float = Field(1.0, description="power of the gain")


class Gain(BaseModel):
    """A number to be found, and the fields that follow from it."""

    model_config = CONFIG

    name: str = Field("", max_length=100, description="name of the gain; its field's unless given")
    field: str = Field("", description="field that it is the value of; instead of sets")
    sets: tuple[Setting, ...] = Field((), description="fields that it sets, [[optimise.gain.sets]] each")
    law: str = Field("", description="law that has it; all unless given")
    low: float = Field(description="least value")
    high: float = Field(description="largest value")
    log: bool = Field(False, description="whether its logarithm is drawn evenly")
    start: float | None = Field(
        None, description="value in the first trial, which all others are held against"
    )

    @model_validator(mode="after")
    def _fits(self) -> Gain:
        if bool(self.field) == bool(self.sets):
            raise ValueError(
                "expected field or sets of a gain, received " + ("both" if self.field else "neither")
            )
        if self.sets and not self.name:
            raise ValueError("expected a name of a gain that sets several fields, received none")
        if not self.low < self.high:
            raise ValueError(f"expected low below high, received {self.low:g} and {self.high:g}")
        if self.low <= 0 and (self.log or any(each.power != 1 for each in self.sets)):
            raise ValueError(f"expected low above 0 of a logarithm or a power, received {self.low:g}")
        if self.start is not None and not self.low <= self.start <= self.high:
            raise ValueError(f"expected start from {self.low:g} to {self.high:g}, received {self.start:g}")
        return self

    @property
    def called(self) -> str:
        """Its name."""
        return self.name or self.field

    @property
    def settings(self) -> tuple[Setting, ...]:
        """Fields that it sets."""
        return self.sets or (Setting(field=self.field),)


class Objective(BaseModel):
    """A figure that is to be as small, or as large, as can be."""

    model_config = CONFIG

    metric: Name = Field(description="figure of a run; NAME for FILE.py:NAME among the study's metrics")
    of: tuple[Literal["alpha", "beta", "gamma"], ...] = Field(
        (), description="entries whose worst is taken, of a figure of each hinge; all unless given"
    )
    direction: Literal["minimise", "maximise"] = Field("minimise", description="which way is better")
    over: Literal["worst", "median"] = Field("worst", description="what is taken over the rows of a trial")

    @model_validator(mode="after")
    def _fits(self) -> Objective:
        if self.of and (self.metric not in METRICS or not METRICS[self.metric].labels):
            raise ValueError(f"expected no entries of {self.metric}, which is one number")
        if len(set(self.of)) < len(self.of):
            raise ValueError(f"expected each entry once, received {', '.join(self.of)}")
        return self

    @property
    def called(self) -> str:
        """Name of the objective, as tables have it."""
        entries = f" of {', '.join(self.of)}" if self.of else ""
        return f"{self.over} {self.metric}{entries}"

    @property
    def places(self) -> list[int]:
        """Places of its entries."""
        return [HINGES.index(each) for each in self.of]

    @property
    def sign(self) -> float:
        """What it is multiplied by to be minimised."""
        return 1.0 if self.direction == "minimise" else -1.0


class Optimise(BaseModel):
    """How the gains of a study's laws are looked for.

    A trial runs every row of the study that is of its law: the seeds, and all points of the axes.
    """

    model_config = CONFIG

    gain: Annotated[tuple[Gain, ...], Field(min_length=1)] = Field(description="[[optimise.gain]] each")
    objective: Annotated[tuple[Objective, ...], Field(min_length=1, max_length=2)] = Field(
        description="[[optimise.objective]] each; of two, the front is found"
    )
    trials: Annotated[int, Field(ge=1, le=MOST_TRIALS)] = Field(100, description="of each law")
    sampler: Literal["tpe", "nsga2", "random"] = Field("tpe", description="what proposes the next trial")
    together: Annotated[int, Field(ge=1, le=1000)] = Field(
        4,
        description="trials that are proposed before the first of them is known: they run side by side, and"
        " what is found depends on it, not on the threads",
    )
    prune: bool = Field(True, description="whether to end a trial that can no longer be among the best")
    fresh: Annotated[int, Field(ge=0, le=MOST_FRESH)] = Field(
        0, description="further seeds that the best are run under, which no trial was chosen by"
    )

    @model_validator(mode="after")
    def _fits(self) -> Optimise:
        objectives = [(each.metric, tuple(sorted(each.of)), each.over) for each in self.objective]
        if len(set(objectives)) < len(objectives):
            raise ValueError(f"expected different objectives, received {self.objective[0].called} twice")
        return self
