"""A study as its TOML says it: a base scenario, what differs from row to row, and what is kept of each."""

from __future__ import annotations

import os
import tomllib
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    JsonValue,
    ValidationError,
    field_validator,
    model_validator,
)

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.user_code import is_reference
from spheretwin.models.base.wording import did_you_mean, shown
from spheretwin.twin.metrics.registry import METRICS
from spheretwin.twin.scenario.explaining import explain
from spheretwin.twin.study.axes.axis import MOST_VALUES, Axis
from spheretwin.twin.study.axes.registry import AnyAxis
from spheretwin.twin.study.tuning.section import Optimise

FOLDER = resources.files("spheretwin.twin.study") / "shipped"


class Study(BaseModel):
    """Many runs of one scenario, some fields of which differ."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    name: Annotated[str, Field(min_length=1)] = Field(description="name of the study")
    description: str = Field("", description="what it shows")
    scenario: Annotated[str, Field(min_length=1)] = Field(description="base: a shipped name or a TOML file")
    fields: dict[str, JsonValue] = Field({}, description="fields of all rows, by dotted name")
    law: tuple[dict[str, JsonValue], ...] = Field(
        (), description="controllers, [[law]] each, with their gains; the scenario's alone unless given"
    )
    axis: tuple[AnyAxis, ...] = Field((), description="what differs from row to row, [[axis]] each")
    design: Literal["random", "latin_hypercube", "sobol"] = Field(
        "latin_hypercube", description="how drawn axes fill their space together"
    )
    samples: Annotated[int, Field(ge=1, le=MOST_VALUES)] | None = Field(
        None, description="points of the drawn axes, each crossed with all else"
    )
    seed: Annotated[int, Field(ge=0)] = Field(
        0, description="of the study: of what is drawn, and of its rows"
    )
    seeds: Annotated[int, Field(ge=1, le=MOST_VALUES)] = Field(
        1, description="runs of each point, each with a seed of its own"
    )
    metrics: tuple[str, ...] = Field(
        (), description="figures to keep, FILE.py:NAME for one of your own; all unless given"
    )
    telemetry: tuple[Annotated[int, Field(ge=0)], ...] = Field(
        (), description="rows whose telemetry is kept, by number"
    )
    optimise: Optimise | None = Field(
        None, exclude=True, description="gains that --optimise looks for; no part of what a sweep runs"
    )
    fast: bool = Field(
        True, description="whether to run on the Lagrangian plant where the model is a free rotor"
    )

    @field_validator("metrics")
    @classmethod
    def _known(cls, metrics: tuple[str, ...]) -> tuple[str, ...]:
        for name in metrics:
            if name not in METRICS and not is_reference(name):
                raise ValueError(
                    f"expected {', '.join(METRICS)} or FILE.py:NAME,"
                    f" received {shown(name)}{did_you_mean(name, METRICS)}"
                )
        return metrics

    @model_validator(mode="after")
    def _fits(self) -> Study:
        drawn = [axis.field for axis in self.axis if axis.is_drawn]
        if drawn and self.samples is None:
            raise ValueError(f"expected samples, as {', '.join(drawn)} is drawn, received none")
        if self.samples is not None and not drawn:
            raise ValueError(f"expected an axis that is drawn for samples, received {self.samples}")
        fields = [axis.field for axis in self.axis]
        if twice := sorted({field for field in fields if fields.count(field) > 1}):
            raise ValueError(f"expected one axis for a field, received {', '.join(twice)} twice")
        if taken := sorted({"seed", "controller.law"} & set(fields)):
            other = {"seed": "seeds", "controller.law": "[[law]]"}
            raise ValueError(f"expected {other[taken[0]]} instead of an axis over {taken[0]}")
        for law in self.law:
            if not isinstance(law.get("law"), str):
                raise ValueError(f"expected law in each [[law]], received {shown(law)}")
        return self

    @property
    def drawn(self) -> tuple[Axis, ...]:
        """Axes whose values are drawn."""
        return tuple(axis for axis in self.axis if axis.is_drawn)


def shipped() -> list[str]:
    """Names of the studies that come with the package."""
    return sorted(path.name.removesuffix(".toml") for path in FOLDER.iterdir() if path.name.endswith(".toml"))


def load(source: str) -> Study:
    """Study of a shipped name, or of a TOML file; paths in it are taken from where the file is.

    Raises
    ------
    InputError
        No such study, or a field that is unknown, of the wrong type or out of range.
    """
    folder = ""
    if source in shipped():
        text = (FOLDER / f"{source}.toml").read_text(encoding="utf-8")
    elif source.endswith(".toml"):
        folder = os.path.dirname(source)
        try:
            text = Path(source).expanduser().read_text(encoding="utf-8-sig")
        except (OSError, ValueError, RuntimeError) as error:
            raise InputError(f"study {source}: expected a readable TOML file, {error}") from None
    else:
        raise InputError(
            f"study: expected {', '.join(shipped())} or a .toml file,"
            f" received {shown(source)}{did_you_mean(source, shipped())}"
        )
    try:
        fields = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"study {source}: expected valid TOML, {error}") from None
    return made(_beside(folder, fields), source)


def made(fields: dict[str, Any], source: str) -> Study:
    """Study of fields as TOML has them.

    Raises
    ------
    InputError
        A field that is unknown, of the wrong type or out of range.
    """
    import json

    try:
        return Study.model_validate_json(json.dumps(fields, default=str))
    except ValidationError as error:
        raise InputError(f"study {source}: {explain(error, Study)}") from None


def _beside(folder: str, fields: dict[str, Any]) -> dict[str, Any]:
    """Take the scenario's path, and those of figures of the user's, from where the study is."""
    scenario = fields.get("scenario")
    if isinstance(scenario, str) and scenario.endswith(".toml"):
        fields["scenario"] = os.path.join(folder, os.path.expanduser(scenario))
    if isinstance(fields.get("metrics"), list):
        fields["metrics"] = [
            os.path.join(folder, os.path.expanduser(each)) if is_reference(each) else each
            for each in fields["metrics"]
        ]
    return fields
