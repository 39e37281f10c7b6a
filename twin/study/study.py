"""Study: a base scenario, axes, laws and seeds of its rows, and the figures of each row."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import lru_cache
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

from spheretwin.metrics import METRICS
from spheretwin.models import mjcf
from spheretwin.models.actuator import MJCF_PATH
from spheretwin.models.base.errors import InputError, did_you_mean, is_plain, shown
from spheretwin.models.base.user_code import is_reference
from spheretwin.scenario.fields import explain
from spheretwin.scenario.reading import read_toml, toml_names
from spheretwin.study.axes import MOST_VALUES, AnyAxis, DrawnAxis
from spheretwin.study.optimise import Optimise

FOLDER = resources.files("spheretwin.study") / "shipped"


class Study(BaseModel):
    """Many runs of one scenario, some fields of which differ."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    name: Annotated[str, Field(min_length=1, max_length=100)] = Field(
        description="name of the study, and of its folder"
    )
    description: str = Field("", description="purpose of the study")
    scenario: Annotated[str, Field(min_length=1)] = Field(description="base: a shipped name or a TOML file")
    folder: str = Field(
        "",
        exclude=True,
        description="folder to which the paths of the study are relative; not part of its digest",
    )
    fields: dict[str, JsonValue] = Field({}, description="fields of all rows, by dotted name")
    law: tuple[dict[str, JsonValue], ...] = Field(
        (), description="controllers, [[law]] each, with their gains, instead of the scenario's"
    )
    axis: tuple[AnyAxis, ...] = Field((), description="fields that differ from row to row, [[axis]] each")
    design: Literal["random", "latin_hypercube", "sobol"] = Field(
        "latin_hypercube", description="design of the points of random axes"
    )
    samples: Annotated[int, Field(ge=1, le=MOST_VALUES)] | None = Field(
        None,
        description="number of points of the random axes, each crossed with all other axes, laws and seeds",
    )
    seed: Annotated[int, Field(ge=0)] = Field(
        0,
        description="seed of the random axes and of the rows, whose seeds replace that of the scenario",
    )
    seeds: Annotated[int, Field(ge=1, le=MOST_VALUES)] = Field(
        1, description="runs of each point, each with another seed"
    )
    common_seeds: bool = Field(
        False, description="whether all points and laws have the same seeds, so that they are paired"
    )
    metrics: tuple[str, ...] = Field(
        (), description="figures of the table, FILE.py:NAME for your own metric; all unless given"
    )
    telemetry: tuple[Annotated[int, Field(ge=0)], ...] = Field(
        (), description="numbers of the rows whose telemetry is stored"
    )
    optimise: Optimise | None = Field(
        None, exclude=True, description="gains that --optimise tunes; without effect on a sweep"
    )
    fast: bool = Field(
        True, description="whether to run on the Lagrangian plant if the model is a free rotor"
    )

    @field_validator("name")
    @classmethod
    def _names_a_folder(cls, name: str) -> str:
        if not is_plain(name) or name.startswith(".") or set(name) & set('/\\:*?"<>|'):
            raise ValueError(f"expected a name that a folder can have, received {shown(name)}")
        return name

    @field_validator("metrics")
    @classmethod
    def _known(cls, metrics: tuple[str, ...]) -> tuple[str, ...]:
        for name in metrics:
            if name not in METRICS and not is_reference(name):
                raise ValueError(
                    f"expected {', '.join(METRICS)} or FILE.py:NAME,"
                    f" received {shown(name)}{did_you_mean(name, METRICS)}"
                )
        names = [name.rpartition(":")[2] for name in metrics]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"expected figures of different names, received {', '.join(twice)} twice")
        return metrics

    @model_validator(mode="after")
    def _fits(self) -> Study:
        random = [axis.field for axis in self.drawn_axes]
        if random and self.samples is None:
            raise ValueError(f"expected samples, as {', '.join(random)} is drawn, received none")
        if self.samples is not None and not random:
            raise ValueError(f"expected an axis that is drawn for samples, received {self.samples}")
        fields = [axis.field for axis in self.axis]
        if twice := sorted({field for field in fields if fields.count(field) > 1}):
            raise ValueError(f"expected one axis for a field, received {', '.join(twice)} twice")
        if taken := sorted({"seed", "controller.law"} & set(fields)):
            other = {"seed": "seeds", "controller.law": "[[law]]"}
            raise ValueError(f"expected {other[taken[0]]} instead of an axis over {taken[0]}")
        self._check_nothing_is_dropped(fields)
        for law in self.law:
            if not isinstance(law.get("law"), str):
                raise ValueError(f"expected law in each [[law]], received {shown(law)}")
        if twice := repeated(self.law):
            raise ValueError(f"expected each [[law]] once, received {shown(twice[0])} twice")
        zips = [axis.zip for axis in self.axis if axis.zip is not None]
        if zipped := [axis.field for axis in self.drawn_axes if axis.zip is not None]:
            raise ValueError(
                f"expected no zip of what is drawn, which goes together as it is, received {zipped[0]}"
            )
        if alone := sorted({name for name in zips if zips.count(name) == 1}):
            raise ValueError(f"expected two axes or more of a zip, received {alone[0]} once")
        return self

    def _check_nothing_is_dropped(self, axes: list[str]) -> None:
        """Refuse fields that another part of the study would overwrite."""
        for field in self.fields:
            if field == "seed":
                raise ValueError("expected seed and seeds of the study, received seed among its fields")
            if field in axes:
                raise ValueError(f"expected {field} among the fields or as an axis, received both")
            of_controller = field == "controller" or field.startswith("controller.")
            if self.law and of_controller and field != "controller.period_s":
                raise ValueError(f"expected {field} in each [[law]], received it among the fields")

    def path(self, path: str) -> str:
        """Path, or reference into a file, relative to the working folder."""
        return os.path.join(self.folder, os.path.expanduser(path))

    @property
    def source(self) -> str:
        """Scenario, its path relative to the working folder."""
        return self.path(self.scenario) if self.scenario.endswith(".toml") else self.scenario

    @property
    def drawn_axes(self) -> tuple[DrawnAxis, ...]:
        """Axes with random values."""
        return tuple(axis for axis in self.axis if isinstance(axis, DrawnAxis))


def repeated(values: Iterable[Any]) -> list[Any]:
    """Values that occur more than once; an integer equals a float of the same value."""
    listed = list(values)
    with suppress(TypeError):  # lists and tables are not hashable
        if len(set(listed)) == len(listed):
            return []
    by_text = [(json.dumps(_alike(value), sort_keys=True), value) for value in listed]
    counts = Counter(text for text, _ in by_text)
    return [value for text, value in dict(by_text).items() if counts[text] > 1]


def _alike(value: Any) -> Any:
    """Convert whole numbers to floats, also in lists and tables."""
    if isinstance(value, list | tuple):
        return [_alike(item) for item in value]
    if isinstance(value, Mapping):
        return {name: _alike(item) for name, item in value.items()}
    is_whole = isinstance(value, int) and not isinstance(value, bool)
    return float(value) if is_whole and abs(value) < 2**53 else value


def shipped() -> list[str]:
    """Names of the studies that come with the package."""
    return toml_names(FOLDER)


def load(source: str) -> Study:
    """Study of a shipped name, or of a TOML file; paths are relative to the folder of the file.

    Raises
    ------
    InputError
        No such study, or a field that is unknown, of the wrong type or out of range.
    """
    fields, folder = read_toml("study", source, FOLDER)
    if isinstance(given := fields.get("folder", ""), str):  # anything else is refused below
        fields["folder"] = os.path.join(folder, given)
    return made(fields, source)


def made(fields: dict[str, Any], source: str) -> Study:
    """Study of fields in the types of TOML.

    Raises
    ------
    InputError
        A field that is unknown, of the wrong type or out of range.
    """
    try:
        return Study.model_validate_json(json.dumps(fields, default=str))
    except ValidationError as error:
        raise InputError(f"study {source}: {explain(error, Study)}") from None


FAST, FULL = "lagrangian", "mujoco"


def fast_engine(named: str | None, integrator: str) -> str:
    """Fastest plant that a scenario allows.

    Parameters
    ----------
    named : str, optional
        Its model file; the shipped one unless given.
    integrator : str
        Its integrator: the equations of motion have one.
    """
    path = Path(named) if named else MJCF_PATH
    return FAST if integrator == "RK4" and _is_free_rotor(path) else FULL


@lru_cache(maxsize=8)
def _is_free_rotor(path: Path) -> bool:
    """True if the Lagrangian covers the model; a model that cannot be read is reported when it is loaded."""
    try:
        return not mjcf.read(path).unknown_to_the_lagrangian
    except InputError:
        return False
