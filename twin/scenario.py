"""Scenarios: everything one run depends on, from TOML and flags, checked as one."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from spheretwin.control.gains import Gains, NonNegative, Positive
from spheretwin.models.errors import InputError
from spheretwin.twin.plant.disturbance import Disturbance
from spheretwin.twin.trajectory import Trajectory, Triple

FOLDER = resources.files("spheretwin.twin") / "scenarios"

# An hour at 1 kHz; the telemetry of a run is held in memory, about 0.6 kB a tick.
MOST_TICKS = 3_600_000

# A tick must end before its user does: 10,000 physics steps take some 50 ms.
MOST_SUBSTEPS = 10_000

# Clock times are built from decimal fractions; a period and a step that fit do so to rounding only.
WHOLE = 1e-9


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Controller(Gains):
    """The law, its gains, and how often it runs."""

    period_s: Annotated[float, Field(gt=0, le=10)] = Field(
        1e-3, description="control period, s; a whole number of physics steps"
    )


class Plant(_Section):
    """The rotor and how its motion is integrated."""

    step_s: Annotated[float, Field(ge=1e-7, le=1)] = Field(5e-4, description="physics step, s")
    integrator: Literal["RK4", "Euler", "implicitfast"] = Field("RK4", description="MuJoCo integrator")
    modelling_error: Annotated[float, Field(gt=-1, le=100)] = Field(
        0.0, description="m: the rotor's inertia is (1 + m) times what the controller assumes"
    )
    modelling_torque_Nm: Triple = Field(
        (0.0, 0.0, 0.0), description="constant torque the controller does not know, N·m (paper: ΔG)"
    )
    payload_kg: NonNegative = Field(0.0, description="point mass on the shaft's payload mount, kg")
    initial_rad: Triple | None = Field(
        None, description="pose at rest at the start, rad; the trajectory's first unless given"
    )
    mjcf: Annotated[str, Field(min_length=1)] | None = Field(
        None, description="model file; the shipped one unless given"
    )
    torque_curve: Annotated[str, Field(min_length=1)] | None = Field(
        None, description="torque curve as CSV; the shipped one unless given"
    )


class DriveSection(_Section):
    """Amplifiers and coils; what is not given comes from the model file."""

    time_constant_s: Annotated[float, Field(ge=0, le=1e3)] | None = Field(
        None, description="current lag L/R, s; 0 for none"
    )
    current_limit_A: Positive | None = Field(None, description="largest group current, A")


class Scenario(_Section):
    """Everything a run depends on."""

    name: str = Field("unnamed", description="name of the scenario")
    description: str = Field("", description="what it shows")
    duration: Positive = Field(5.0, description="length of the run, s")
    seed: Annotated[int, Field(ge=0)] = Field(0, description="seed of the random torque")
    allocation: Literal["least_norm", "bounded"] = Field(
        "least_norm",
        description="currents for a torque: least-norm and scaled at the limit (16), or all the limit allows",
    )
    trajectory: Trajectory
    controller: Controller = Controller()
    plant: Plant = Plant()
    drive: DriveSection = DriveSection()
    disturbance: Disturbance = Disturbance()

    @model_validator(mode="after")
    def _clocks_fit(self) -> Scenario:
        ratio = self.controller.period_s / self.plant.step_s
        if round(ratio) < 1 or round(ratio) > MOST_SUBSTEPS or abs(ratio - round(ratio)) > WHOLE * ratio:
            raise ValueError(
                f"expected controller.period_s a whole multiple of plant.step_s, 1 to {MOST_SUBSTEPS} times,"
                f" received {self.controller.period_s:g} and {self.plant.step_s:g} s"
            )
        if not 1 <= self.ticks <= MOST_TICKS:
            raise ValueError(
                f"expected a duration of 1 to {MOST_TICKS} control periods, received {self.duration:g} s"
            )
        return self

    @property
    def ticks(self) -> int:
        """Control ticks of the run."""
        return int(self.duration / self.controller.period_s * (1 + WHOLE))

    @property
    def substeps(self) -> int:
        """Physics steps in a control period."""
        return round(self.controller.period_s / self.plant.step_s)


def shipped() -> list[str]:
    """Names of the scenarios that come with the package."""
    return sorted(path.name.removesuffix(".toml") for path in FOLDER.iterdir() if path.name.endswith(".toml"))


def load(source: str, overrides: Mapping[str, Any] | None = None) -> Scenario:
    """Read a scenario and override some of its fields.

    Parameters
    ----------
    source : str
        A shipped name, or the path of a TOML file.
    overrides : mapping, optional
        Values by dotted name, such as ``{"controller.law": "pd"}``.

    Raises
    ------
    InputError
        No such scenario, or a field that is unknown, of the wrong type or out of range.
    """
    fields = _read(source)
    for dotted, value in (overrides or {}).items():
        _override(fields, dotted, value)
    try:
        # By way of JSON, so that arrays become tuples while numbers stay strictly typed.
        return Scenario.model_validate_json(json.dumps(fields, default=str))
    except ValidationError as error:
        raise InputError(f"scenario {source}: {explain(error)}") from None


def explain(error: ValidationError) -> str:
    """First complaint of a validation on one line: field, what was expected, what was received."""
    first = error.errors(include_url=False)[0]
    path = [str(part) for part in first["loc"]]
    if first["type"] == "value_error" and not path:
        return str(first["ctx"]["error"])
    if first["type"] == "extra_forbidden":
        valid = ", ".join(_names_at(path[:-1]))
        return f"expected one of {valid} in {_dotted(path[:-1]) or 'the scenario'}, received {path[-1]}"
    if first["type"] == "missing":
        return f"{_dotted(path)}: expected a value, received none"
    expected = first["msg"].removeprefix("Input should be ")
    return f"{_dotted(path)}: expected {expected}, received {first['input']!r}"


def fields_of(section: type[BaseModel] | BaseModel, prefix: str = "") -> dict[str, Any]:
    """Dotted name of every field below a section, with pydantic's description of it."""
    kind = section if isinstance(section, type) else type(section)
    found: dict[str, Any] = {}
    for name, field in kind.model_fields.items():
        value = field.default if isinstance(section, type) else getattr(section, name)
        if isinstance(value, BaseModel):
            found |= fields_of(value, f"{prefix}{name}.")
        else:
            found[prefix + name] = field
    return found


def _read(source: str) -> dict[str, Any]:
    if source in shipped():
        text = (FOLDER / f"{source}.toml").read_text(encoding="utf-8")
    elif source.endswith(".toml"):
        try:
            text = Path(source).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"scenario {source}: expected a readable TOML file, {error}") from None
    else:
        raise InputError(f"scenario: expected {', '.join(shipped())} or a .toml file, received {source}")
    try:
        fields = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"scenario {source}: expected valid TOML, {error}") from None
    return _beside(Path(source), fields)


def _beside(source: Path, fields: dict[str, Any]) -> dict[str, Any]:
    """Take the paths that a scenario file names from where the file is."""
    plant = fields.get("plant")
    for name in ("mjcf", "torque_curve"):
        if isinstance(plant, dict) and isinstance(plant.get(name), str) and plant[name]:
            plant[name] = str(source.parent / plant[name])
    return fields


def _override(fields: dict[str, Any], dotted: str, value: Any) -> None:
    *sections, name = dotted.split(".")
    for section in sections:
        fields = fields.setdefault(section, {})
        if not isinstance(fields, dict):
            raise InputError(f"scenario: expected a section before the dot, received {dotted}")
    fields[name] = value


def _names_at(path: list[str]) -> list[str]:
    """Valid names of the section at `path`, whose union tags pydantic puts into the path."""
    section: Any = Scenario
    for part in path:
        if part == "trajectory":
            section = {kind.model_fields["shape"].default: kind for kind in _shapes()}
        elif isinstance(section, dict):
            section = section[part]
        else:
            section = section.model_fields[part].annotation
    return list(section.model_fields)


def _shapes() -> tuple[type[BaseModel], ...]:
    union, *_ = Trajectory.__args__
    return union.__args__


def _dotted(path: list[str]) -> str:
    tags = {kind.model_fields["shape"].default for kind in _shapes()}
    return ".".join(part for i, part in enumerate(path) if not (i == 1 and part in tags))
