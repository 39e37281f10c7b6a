"""Section ``[optimise]`` of a study: gains with ranges, objectives, and the search."""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from spheretwin.metrics import METRICS

CONFIG = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

MOST_TRIALS = 100_000
MOST_FRESH = 1000

HINGES = ("alpha", "beta", "gamma")

SWITCH, ON = ", on", 0.5
"""Suffix of the name of a switch, and the value from which its gain is on: half of its range."""

Name = Annotated[str, Field(min_length=1, max_length=100)]


class Setting(BaseModel):
    """A field that a gain sets: ``factor gain^power``; if several gains set one field, their product."""

    model_config = CONFIG

    field: Name = Field(description="dotted name, as on a command line")
    factor: float = Field(1.0, description="factor of the power of the gain")
    power: float = Field(1.0, description="power of the gain")


class Gain(BaseModel):
    """Tuned number, and the fields that it sets."""

    model_config = CONFIG

    name: str = Field("", max_length=100, description="name of the gain; that of its field unless given")
    field: str = Field("", description="field whose value it is; instead of sets")
    sets: tuple[Setting, ...] = Field((), description="fields that it sets, [[optimise.gain.sets]] each")
    law: str = Field("", description="law of the gain; all laws unless given")
    low: float = Field(description="least value")
    high: float = Field(description="largest value")
    log: bool = Field(False, description="whether its logarithm is uniform")
    start: float | None = Field(
        None, description="value in the first trial, with which all others are compared"
    )
    optional: bool = Field(
        False, description="whether a trial may switch it off: then its fields keep their values"
    )
    reason: str = Field("", max_length=200, description="reason for the range, for the report")

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
        if self.low <= 0 and (self.log or any(setting.power != 1 for setting in self.sets)):
            raise ValueError(f"expected low above 0 of a logarithm or a power, received {self.low:g}")
        if self.start is not None and not self.low <= self.start <= self.high:
            raise ValueError(f"expected start from {self.low:g} to {self.high:g}, received {self.start:g}")
        return self

    @property
    def called(self) -> str:
        """Name of the gain."""
        return self.name or self.field

    @property
    def switch(self) -> str:
        """Name of the number that says whether an optional gain is on: from `ON` to 1; off below."""
        return f"{self.called}{SWITCH}"

    @property
    def settings(self) -> tuple[Setting, ...]:
        """Fields that it sets."""
        return self.sets or (Setting(field=self.field),)


class Objective(BaseModel):
    """Figure that is minimised or maximised."""

    model_config = CONFIG

    metric: Name = Field(description="figure of a run; NAME for FILE.py:NAME among the study's metrics")
    of: tuple[Literal["alpha", "beta", "gamma"], ...] = Field(
        (), description="hinges whose worst value counts, for a figure of each hinge; all unless given"
    )
    direction: Literal["minimise", "maximise"] = Field("minimise", description="direction of improvement")
    over: Literal["worst", "median", "geometric_mean", "first"] = Field(
        "worst", description="statistic over the rows of a trial; first is the first row alone"
    )
    limits: Annotated[tuple[Annotated[float, Field(gt=0)], ...], Field(max_length=20)] = Field(
        (),
        description="limits on the second objective; the best of the first objective within each is reported"
        " instead of the front",
    )

    @model_validator(mode="after")
    def _fits(self) -> Objective:
        if self.of and (self.metric not in METRICS or not METRICS[self.metric].labels):
            raise ValueError(f"expected no entries of {self.metric}, which is one number")
        if len(set(self.of)) < len(self.of):
            raise ValueError(f"expected each entry once, received {', '.join(self.of)}")
        if list(self.limits) != sorted(set(self.limits)):
            raise ValueError(f"expected ascending limits, received {', '.join(map(str, self.limits))}")
        if self.direction == "maximise" and (self.limits or self.over == "geometric_mean"):
            raise ValueError(
                f"expected minimise with {'limits' if self.limits else 'geometric_mean'}, received maximise"
            )
        return self

    @property
    def called(self) -> str:
        """Name of the objective in tables."""
        entries = f" of {', '.join(self.of)}" if self.of else ""
        return f"{self.over} {self.metric}{entries}"

    @property
    def places(self) -> list[int]:
        """Places of its entries."""
        return [HINGES.index(hinge) for hinge in self.of]

    @property
    def sign(self) -> float:
        """Factor with which the objective is minimised."""
        return 1.0 if self.direction == "minimise" else -1.0


class Optimise(BaseModel):
    """Search for the gains of the laws of a study.

    A trial runs every row of the study that is of its law: the seeds, and all points of the axes.
    """

    model_config = CONFIG

    gain: Annotated[tuple[Gain, ...], Field(min_length=1)] = Field(description="[[optimise.gain]] each")
    objective: Annotated[tuple[Objective, ...], Field(min_length=1, max_length=2)] = Field(
        description="[[optimise.objective]] each; with two, the result is a Pareto front"
    )
    trials: Annotated[int, Field(ge=1, le=MOST_TRIALS)] = Field(
        100, description="trials of each law; the sampler local has draws and perturbations instead"
    )
    sampler: Literal["tpe", "nsga2", "random", "local"] = Field(
        "tpe",
        description="what proposes the next trial; local: points of a Sobol sequence, then perturbations of"
        " the best trial within each limit in turn",
    )
    draws: Annotated[int, Field(ge=1, le=MOST_TRIALS)] = Field(
        70, description="points of the Sobol sequence that local begins with"
    )
    perturbations: Annotated[int, Field(ge=1, le=MOST_TRIALS)] = Field(
        35, description="perturbations by local of the best trial within each limit"
    )
    together: Annotated[int, Field(ge=1, le=1000)] = Field(
        4,
        description="trials that are proposed before the first of them is known: they run side by side, and"
        " what is found depends on it, not on the threads",
    )
    prune: bool = Field(True, description="whether to end trials that can no longer be among the best")
    fresh: Annotated[int, Field(ge=0, le=MOST_FRESH)] = Field(
        0, description="further seeds for the best trials, which the choice of the trials did not use"
    )

    @model_validator(mode="after")
    def _fits(self) -> Optimise:
        objectives = [
            (objective.metric, tuple(sorted(objective.of)), objective.over) for objective in self.objective
        ]
        if len(set(objectives)) < len(objectives):
            raise ValueError(f"expected different objectives, received {self.objective[0].called} twice")
        fields = type(self).model_fields
        changed = {name for name, field in fields.items() if getattr(self, name) != field.default}
        if self.sampler == "local" and "trials" in changed:
            raise ValueError("expected draws and perturbations of the sampler local, received trials")
        if self.sampler != "local" and (wrong := sorted({"draws", "perturbations"} & changed)):
            raise ValueError(f"expected {wrong[0]} with the sampler local alone, received {self.sampler}")
        if self.objective[0].limits:
            raise ValueError("expected limits on the second of two objectives, received them on the first")
        return self

    @property
    def planned(self) -> int:
        """Trials of each law."""
        if self.sampler == "local":
            return self.draws + self.perturbations * max(len(self.limits), 1)
        return self.trials

    @property
    def limits(self) -> tuple[float, ...]:
        """Limits on the second objective; empty if there are none."""
        return self.objective[-1].limits


BEST = -math.inf


def of_row(objective: Objective, figure: Any) -> float | None:
    """Return a figure of one run as a number to be minimised; None if it is no number."""
    entries = figure if isinstance(figure, list) else [figure]
    chosen = [entries[place] for place in objective.places] if objective.of and len(entries) == 3 else entries
    if not chosen or not all(_is_number(value) for value in chosen):
        return None
    return max(objective.sign * float(value) for value in chosen)


def of_rows(objective: Objective, known: Sequence[float], rows: int) -> float:
    """Objective of a trial, or its lower bound as long as rows are missing.

    Parameters
    ----------
    objective : Objective
    known : sequence of float
        Of the rows that have been run, to be minimised; one at least where no row is to come.
    rows : int
        Of the trial.
    """
    if objective.over == "first":
        return known[0] if known else BEST
    if objective.over == "geometric_mean":
        return statistics.geometric_mean(known) if len(known) == rows and min(known) > 0 else 0.0
    whole = [*known, *[BEST] * (rows - len(known))]
    return max(whole) if objective.over == "worst" else statistics.median(whole)


def best_within(values: Mapping[int, Sequence[float]], limit: float) -> int | None:
    """Trial with the least first objective among those whose second is within a limit; None without any."""
    within = [number for number, pair in values.items() if pair[1] <= limit]
    return min(within, key=lambda number: (*values[number], number), default=None)


def dominates(one: Sequence[float], other: Sequence[float]) -> bool:
    """Whether objectives are as good as others in each, and better in one."""
    pairs = list(zip(one, other, strict=True))
    return all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
