"""How far a run may be from a reference, signal by signal, as a TOML file of the user's says it."""

from __future__ import annotations

import json
import tomllib
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.wording import did_you_mean, shown, without_breaks
from spheretwin.twin.scenario.explaining import explain

FOLDER = resources.files("spheretwin.twin.review") / "shipped"

Allowance = Annotated[float, Field(ge=0)]


class Tolerance(BaseModel):
    """What one signal is allowed; exactly the reference unless told otherwise."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    absolute: Allowance = Field(0.0, description="difference, in the unit of the signal")
    relative: Allowance = Field(
        0.0, description="difference over the reference's magnitude; adds to absolute"
    )
    time_s: Annotated[float, Field(ge=0, le=1e3)] = Field(
        0.0, description="how much earlier or later the reference may have the value, s"
    )


class Tolerances(BaseModel):
    """What each signal is allowed; a signal that is not named may be anything."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    description: str = Field("", description="what it holds, and why so closely")
    signals: Annotated[dict[str, Tolerance], Field(min_length=1)] = Field(
        description="by the name of the telemetry column"
    )


def shipped() -> list[str]:
    """Names of the tolerances that come with the package."""
    return sorted(path.name.removesuffix(".toml") for path in FOLDER.iterdir() if path.name.endswith(".toml"))


def load(source: str) -> Tolerances:
    """Tolerances of a shipped name or of a TOML file.

    Raises
    ------
    InputError
        It cannot be read, or a field is unknown, of the wrong type or out of range.
    """
    if not (source in shipped() or source.endswith(".toml")):
        raise InputError(
            f"tolerance: expected {', '.join(shipped())} or a .toml file,"
            f" received {shown(source)}{did_you_mean(source, shipped())}"
        )
    path = FOLDER / f"{source}.toml" if source in shipped() else Path(source)
    try:
        fields = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(
            f"tolerance {source}: expected a readable TOML file, {without_breaks(error)}"
        ) from None
    try:
        return Tolerances.model_validate_json(json.dumps(fields, default=str))
    except ValidationError as error:
        raise InputError(f"tolerance {source}: {_complaint(error, fields)}") from None


def _complaint(error: ValidationError, fields: dict[str, Any]) -> str:
    """First complaint; of a signal's own table it is that of the table by itself, which knows its fields."""
    match error.errors()[0]["loc"]:
        case ("signals", str() as name, _, *_):
            try:
                Tolerance.model_validate_json(json.dumps(fields["signals"][name], default=str))
            except ValidationError as inner:
                return f"signals.{name}: {explain(inner, Tolerance)}"
    return explain(error, Tolerances)
