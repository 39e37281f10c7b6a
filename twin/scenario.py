"""Scenarios: everything one run depends on, from TOML and flags, checked as one."""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializeAsAny,
    ValidationError,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from spheretwin.control.gains import Gains, NonNegative, Positive
from spheretwin.control.laws import LAWS
from spheretwin.models.errors import InputError
from spheretwin.models.wording import did_you_mean, is_plain, shown
from spheretwin.twin.plant.disturbance import Disturbance
from spheretwin.twin.trajectory import Bounded, Trajectory, Triple

NonNegativeTriple = tuple[NonNegative, NonNegative, NonNegative]

PATHS = ("plant.mjcf", "plant.torque_curve", "nominal.torque_curve")
"""Fields that name a file."""

FOLDER = resources.files("spheretwin.twin") / "scenarios"

# A torque matrix of nothing asks for endless currents.
LEAST_SCALE = 1e-3

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


class OwnController(_Section):
    """What a run under a law of the user's says of it, in the place of `Controller`."""

    law: str = Field(description="name of the law")
    period_s: float = Field(description="control period, s")
    parameters: tuple[float, ...] = Field(description="numbers handed to the law")


class Plant(_Section):
    """The rotor as it really is, and how its motion is integrated."""

    engine: Literal["mujoco", "lagrangian"] = Field(
        "mujoco", description="what computes the motion: MuJoCo, or the equations of motion (faster)"
    )
    step_s: Annotated[float, Field(ge=1e-7, le=1)] = Field(5e-4, description="physics step, s")
    integrator: Literal["RK4", "Euler", "implicitfast"] = Field(
        "RK4", description="integrator of MuJoCo; the Lagrangian has RK4 alone"
    )
    modelling_error: Annotated[float, Field(gt=-1, le=100)] = Field(
        0.0, description="m: the rotor's inertia is (1 + m) times the model file's"
    )
    modelling_torque_Nm: Triple = Field(
        (0.0, 0.0, 0.0), description="constant torque the controller does not know, N·m (paper: ΔG)"
    )
    gravity_m_s2: Annotated[float, Field(ge=0, le=100)] | None = Field(
        None, description="gravity along -z, m/s²; the model's unless given"
    )
    coulomb_Nm: NonNegativeTriple = Field(
        (0.0, 0.0, 0.0), description="Coulomb friction of each hinge, N·m, beside what the model has"
    )
    viscous_Nm_s: NonNegativeTriple = Field(
        (0.0, 0.0, 0.0), description="viscous friction of each hinge, N·m·s, beside what the model has"
    )
    friction_smoothing_rad_s: Annotated[float, Field(ge=1e-9, le=1e3)] = Field(
        0.01, description="rate over which Coulomb friction changes sign, rad/s"
    )
    group_gain: tuple[Bounded, ...] | None = Field(
        None, description="torque an ampere of each group over that of the torque curve; 1 unless given"
    )
    payload_kg: NonNegative = Field(0.0, description="point mass on the shaft's payload mount, kg")
    initial_rad: Triple | None = Field(
        None, description="pose at the start, rad; the trajectory's first unless given"
    )
    initial_rad_s: Triple = Field((0.0, 0.0, 0.0), description="rates at the start, rad/s")
    mjcf: Annotated[str, Field(min_length=1)] | None = Field(
        None, description="model file; the shipped one unless given"
    )
    torque_curve: Annotated[str, Field(min_length=1)] | None = Field(
        None, description="torque curve as CSV; the shipped one unless given"
    )


class Nominal(_Section):
    """The model that the controller has; what is not given is as the plant is without modelling error."""

    torque_curve: Annotated[str, Field(min_length=1)] | None = Field(
        None, description="torque curve as CSV; the plant's unless given"
    )
    torque_scale: Annotated[float, Field(ge=-1e3, le=1e3)] = Field(
        1.0, description="torque matrix over that of the torque curve; below 0, its sign is wrong"
    )
    inertia_kg_m2: tuple[Positive, Positive, Positive] | None = Field(
        None, description="principal inertias of the rotor, kg·m²; the model file's unless given"
    )
    current_limit_A: Positive | None = Field(
        None, description="largest group current asked for, A; the drive's unless given"
    )

    @field_validator("torque_scale")
    @classmethod
    def _not_nothing(cls, scale: float) -> float:
        if abs(scale) < LEAST_SCALE:
            raise PydanticCustomError("scale", f"Input should be at least {LEAST_SCALE:g} in magnitude")
        return scale


class SensorsSection(_Section):
    """How the controller sees the rotor."""

    angle_offset_rad: Triple = Field((0.0, 0.0, 0.0), description="constant error of each angle, rad")


class DriveSection(_Section):
    """Amplifiers and coils; what is not given comes from the model file."""

    time_constant_s: Annotated[float, Field(ge=0, le=1e3)] | None = Field(
        None, description="current lag L/R, s; 0 for none"
    )
    current_limit_A: Positive | None = Field(None, description="largest group current of the amplifiers, A")


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
    controller: SerializeAsAny[Controller] = Controller()
    nominal: Nominal = Nominal()
    sensors: SensorsSection = SensorsSection()
    plant: Plant = Plant()
    drive: DriveSection = DriveSection()
    disturbance: Disturbance = Disturbance()

    @model_validator(mode="after")
    def _clocks_fit(self) -> Scenario:
        ratio = self.controller.period_s / self.plant.step_s
        if round(ratio) < 1 or round(ratio) > MOST_SUBSTEPS or abs(ratio - round(ratio)) > WHOLE * ratio:
            raise ValueError(
                f"expected controller.period_s a whole multiple of plant.step_s, 1 to {MOST_SUBSTEPS} times,"
                f" received {self.controller.period_s!r} and {self.plant.step_s!r} s"
            )
        if self.ticks < 1:
            raise ValueError(
                f"expected a duration of at least one control period, received {self.duration!r} s"
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
        A shipped name, or the path of a TOML file; ``~`` is the user's home. Paths in the file are taken
        from where the file is.
    overrides : mapping, optional
        Values by dotted name, such as ``{"controller.law": "pd"}``; paths are taken from the working folder.

    Raises
    ------
    InputError
        No such scenario, or a field that is unknown, of the wrong type or out of range.
    """
    fields = _read(source)
    for dotted, value in (overrides or {}).items():
        _override(fields, dotted, value)
    return _validated(beside("", fields), source)


def from_record(fields: Mapping[str, Any], source: str) -> Scenario:
    """Scenario from what a run said of itself, the fields by section.

    Raises
    ------
    InputError
        It was run under a law of its user's, or by a version with other fields.
    """
    law = fields.get("controller", {}).get("law")
    if law not in LAWS:
        raise InputError(
            f"scenario {source}: expected a run under {', '.join(LAWS)}, received one under {law},"
            " a law that its file does not hold"
        )
    return _validated(fields, source)


def changed(scenario: Scenario, dotted: str, value: Any) -> Scenario:
    """Scenario with another value of one field, checked as a whole; paths are taken as `load` takes them.

    Raises
    ------
    InputError
        A field that is unknown, of the wrong type or out of range.
    """
    fields = scenario.model_dump(mode="json")
    if isinstance(scenario.controller, OwnController):
        fields["controller"] = {"period_s": scenario.controller.period_s}
    _override(fields, dotted, value)
    return _validated(beside("", fields), scenario.name)


def beside(folder: str, fields: dict[str, Any]) -> dict[str, Any]:
    """Take the paths that fields by section name from a folder, in place; a second time changes nothing."""
    for dotted in PATHS:
        section, name = dotted.split(".")
        inside = fields.get(section)
        if isinstance(inside, dict) and isinstance(inside.get(name), str) and inside[name]:
            inside[name] = os.path.join(folder, _from_home(inside[name]))
    return fields


def as_plain(value: Any) -> Any:
    """Arrays and NumPy's numbers as Python has them; anything else, as a date of a TOML file, as text."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)


def explain(error: ValidationError) -> str:
    """First complaint of a validation on one line: field, what was expected, what was received."""
    first = error.errors(include_url=False)[0]
    path = [str(part) for part in first["loc"]]
    field, received = _dotted(path), shown(first["input"])
    match first["type"]:
        case "value_error":
            complaint = str(first["ctx"]["error"])
            return f"{field}: {complaint}" if path else complaint
        case "json_invalid":
            return f"expected sections and values as TOML has them, received {first['ctx']['error']}"
        case "extra_forbidden":
            return _unknown(path)
        case "missing":
            return f"{field}: expected a value, received none"
        case "union_tag_not_found" | "union_tag_invalid":
            tag, shapes = first["ctx"].get("tag"), [*_by_shape()]
            near = did_you_mean(str(tag), shapes)
            received = "none" if tag is None else shown(tag)
            return f"{field}.shape: expected one of {', '.join(shapes)}, received {received}{near}"
        case "literal_error":
            valid = re.findall("'([^']*)'", first["ctx"]["expected"])
            near = did_you_mean(str(first["input"]), valid)
            return f"{field}: expected {first['ctx']['expected']}, received {received}{near}"
    expected = first["msg"].removeprefix("Input should be ")
    return f"{field}: expected {expected}, received {received}"


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


def _validated(fields: Mapping[str, Any], source: str) -> Scenario:
    try:
        scenario = Scenario.model_validate_json(_as_json(source, fields))
    except ValidationError as error:
        raise InputError(f"scenario {source}: {explain(error)}") from None
    _check_texts(source, scenario)
    return scenario


def _read(source: str) -> dict[str, Any]:
    path = _from_home(source)
    if source in shipped():
        text = (FOLDER / f"{source}.toml").read_text(encoding="utf-8")
    elif source.endswith(".toml"):
        try:
            text = Path(path).read_text(encoding="utf-8-sig")  # some editors write a byte-order mark
        except (OSError, ValueError) as error:  # ValueError: no UTF-8, or a zero in the path
            raise InputError(f"scenario {source}: expected a readable TOML file, {error}") from None
    else:
        raise InputError(
            f"scenario: expected {', '.join(shipped())} or a .toml file,"
            f" received {shown(source)}{did_you_mean(source, shipped())}"
        )
    try:
        fields = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"scenario {source}: expected valid TOML, {error}") from None
    return beside(os.path.dirname(path), fields)


def _from_home(path: str) -> str:
    try:
        return os.path.expanduser(path)
    except ValueError:  # a zero in the name of a user; it is refused where the path is used
        return path


def _override(fields: dict[str, Any], dotted: str, value: Any) -> None:
    if not isinstance(dotted, str) or not all(dotted.split(".")):
        raise InputError(f"scenario: expected a field such as controller.law, received {shown(dotted)}")
    *sections, name = dotted.split(".")
    for section in sections:
        fields = fields.setdefault(section, {})
        if not isinstance(fields, dict):
            raise InputError(f"scenario: expected a section before the dot, received {dotted}")
    fields[name] = value


def _as_json(source: str, fields: Mapping[str, Any]) -> bytes:
    """Fields as JSON, so that arrays become tuples while numbers stay strictly typed."""
    try:
        return json.dumps(fields, default=as_plain, ensure_ascii=False).encode()
    except (TypeError, ValueError, RecursionError) as error:  # endless digits, bytes that are no text, depth
        raise InputError(
            f"scenario {source}: expected sections and values as TOML has them, {error}"
        ) from None


def _check_texts(source: str, scenario: Scenario) -> None:
    """Names and paths end up in terminals, in file names and in other programs' files."""
    for dotted in fields_of(scenario):
        text: Any = scenario
        for part in dotted.split("."):
            text = getattr(text, part)
        breaks = "\n\t" if dotted == "description" else ""
        if isinstance(text, str) and not is_plain("".join(each for each in text if each not in breaks)):
            raise InputError(
                f"scenario {source}: {dotted}: expected text without control characters,"
                f" received {shown(text)}"
            )


def _unknown(path: list[str]) -> str:
    """Complaint about a name that its section does not have."""
    *section, name = path
    valid = _names_at(section)
    elsewhere = next((f"; did you mean {d}?" for d in fields_of(Scenario) if d.endswith(f".{name}")), "")
    return (
        f"expected one of {', '.join(valid)} in {_dotted(section) or 'the scenario'},"
        f" received {name}{did_you_mean(name, valid) or elsewhere}"
    )


def _names_at(path: list[str]) -> list[str]:
    """Valid names of the section at `path`, whose union tags pydantic puts into the path."""
    section: Any = Scenario
    for part in path:
        if part == "trajectory":
            section = _by_shape()
        elif isinstance(section, dict):
            section = section[part]
        else:
            section = section.model_fields[part].annotation
    return list(section.model_fields)


def _by_shape() -> dict[str, type[BaseModel]]:
    union, *_ = Trajectory.__args__
    return {kind.model_fields["shape"].default: kind for kind in union.__args__}


def _dotted(path: list[str]) -> str:
    tags = _by_shape()
    return ".".join(part for i, part in enumerate(path) if not (i == 1 and part in tags))
