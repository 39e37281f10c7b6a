"""Column map: which columns of a file are time, angles and currents, and how raw numbers become SI."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from spheretwin.machine.log import COMMANDED, MEASURED, Log
from spheretwin.models.base.errors import InputError, did_you_mean, without_breaks
from spheretwin.models.base.files import regular_file
from spheretwin.models.telemetry.joint_states import ANGLE_NAMES
from spheretwin.scenario.fields import explain

Array = NDArray[np.float64]
Numbers = tuple[float, ...]

CONFIG = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)
EVERY = "*"
"""End of a name that stands for the same name followed by 0, 1, 2, ... as far as the file has them."""

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
ANGLE_UNITS = {"rad": 1.0, "deg": math.pi / 180, "turn": 2 * math.pi}
CURRENT_UNITS = {"A": 1.0, "mA": 1e-3}


class TimeColumn(BaseModel):
    """Column of the time."""

    model_config = CONFIG

    column: str = Field("t_s", description="name of the column")
    unit: Literal["s", "ms", "us", "ns"] = Field("s", description="unit of its numbers")


class Channels(BaseModel):
    """Columns of one quantity: ``value = sign * unit * scale * (number - offset)``.

    Each list has an entry for each column, or one entry for all.
    """

    model_config = CONFIG

    columns: Annotated[tuple[str, ...], Field(min_length=1)] = Field(
        description="names, in the order of the axes"
    )
    sign: Annotated[tuple[Literal[1, -1], ...], Field(min_length=1)] = Field((1,), description="1 or -1")
    scale: Annotated[Numbers, Field(min_length=1)] = Field(
        (1.0,), description="unit over one raw number, such as rad/V or turns per count"
    )
    offset: Annotated[Numbers, Field(min_length=1)] = Field((0.0,), description="raw number at zero")
    wrap: Annotated[Numbers, Field(min_length=1)] = Field(
        (0.0,), description="raw numbers after which a counter starts again; 0 for none"
    )

    @model_validator(mode="after")
    def _fits(self) -> Channels:
        if EVERY not in "".join(self.columns):
            for name in ("sign", "scale", "offset", "wrap"):
                if (count := len(getattr(self, name))) not in (1, len(self.columns)):
                    raise ValueError(
                        f"expected {name} once or for {len(self.columns)} columns, received {count}"
                    )
        if 0 in self.scale:
            raise ValueError("expected a scale other than 0, received 0")
        if min(self.wrap) < 0:
            raise ValueError(f"expected a wrap of at least 0, received {min(self.wrap):g}")
        return self

    def names(self, available: Sequence[str]) -> list[str]:
        """Return the names of the columns in a file with the available ones."""
        names: list[str] = []
        for name in self.columns:
            if name.endswith(EVERY):
                count = 0
                while (numbered := f"{name[:-1]}{count}") in available:
                    names.append(numbered)
                    count += 1
                names.extend([] if count else [f"{name[:-1]}0"])
            else:
                names.append(name)
        return names

    def values(self, raw: Array, unit: float) -> Array:
        """Return the values of raw numbers (n, columns)."""
        unwrapped = raw.copy()
        for place, wrap in enumerate(np.broadcast_to(self.wrap, raw.shape[1])):
            if wrap:
                finite = np.isfinite(raw[:, place])
                unwrapped[finite, place] = np.unwrap(raw[finite, place], period=wrap)
        return np.array(self.sign) * unit * np.array(self.scale) * (unwrapped - np.array(self.offset))


class AngleColumns(Channels):
    """Columns of the angles alpha, beta, gamma, in this order."""

    unit: Literal["rad", "deg", "turn"] = Field("rad", description="unit of numbers times scale")

    @model_validator(mode="after")
    def _three(self) -> AngleColumns:
        if len(self.columns) != 3:
            raise ValueError(f"expected columns of three angles, received {len(self.columns)}")
        return self


class CurrentColumns(Channels):
    """Columns of the currents of the coil groups, in their order."""

    unit: Literal["A", "mA"] = Field("A", description="unit of numbers times scale")
    kind: Literal["commanded", "measured"] = Field(
        "commanded", description="sent to the amplifiers and held, or measured in the coils"
    )


class ColumnMap(BaseModel):
    """Map of a file's columns."""

    model_config = CONFIG

    time: TimeColumn = TimeColumn()
    angles: AngleColumns
    currents: CurrentColumns
    conditions: dict[str, Any] = Field(
        default_factory=dict, description="known fields of the scenario during the log"
    )

    def log(self, columns: Mapping[str, Array], name: str, accepted: tuple[str, ...] = ()) -> Log:
        """Return the log of columns of a file.

        Raises
        ------
        InputError
            A column is missing.
        """
        angles, currents = self.angles.names(tuple(columns)), self.currents.names(tuple(columns))
        for column in (self.time.column, *angles, *currents):
            if column not in columns:
                raise InputError(
                    f"log {name}: expected a column {column} of numbers, received {', '.join(columns)}"
                    f"{did_you_mean(column, columns)}"
                )
        for field in ("sign", "scale", "offset", "wrap"):
            if (count := len(getattr(self.currents, field))) not in (1, len(currents)):
                raise InputError(
                    f"log {name}: expected currents.{field} once or for {len(currents)} columns,"
                    f" received {count}"
                )
        return Log(
            TIME_UNITS[self.time.unit] * columns[self.time.column],
            self.currents.values(_table(columns, currents), CURRENT_UNITS[self.currents.unit]),
            self.angles.values(_table(columns, angles), ANGLE_UNITS[self.angles.unit]),
            self.currents.kind,
            name,
            self.conditions,
            accepted,
        )


def _table(columns: Mapping[str, Array], names: Sequence[str]) -> Array:
    return np.stack([columns[name] for name in names], axis=1)


def load(source: str | Path) -> ColumnMap:
    """Load a column map from a TOML file.

    Raises
    ------
    InputError
        It cannot be read, or a field is unknown, of the wrong type or out of range.
    """
    try:
        fields = tomllib.loads(regular_file(source).read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(
            f"columns {source}: expected a readable TOML file, {without_breaks(error)}"
        ) from None
    return of_fields(fields, str(source))


def of_fields(fields: Mapping[str, Any], source: str = "given") -> ColumnMap:
    """Return the column map of fields as in TOML.

    Raises
    ------
    InputError
        A field is unknown, of the wrong type or out of range.
    """
    fields = {**fields, "conditions": _flat(fields.get("conditions", {}))}
    try:
        return ColumnMap.model_validate_json(json.dumps(fields, default=str))
    except ValidationError as error:
        raise InputError(f"columns {source}: {explain(error, ColumnMap)}") from None


def _flat(fields: Any, prefix: str = "") -> Any:
    """Return conditions by dotted name: TOML reads ``plant.payload_kg`` without quotes as a table."""
    if not isinstance(fields, Mapping):
        return fields
    flat: dict[str, Any] = {}
    for name, value in fields.items():
        flat |= _flat(value, f"{prefix}{name}.") if isinstance(value, Mapping) else {f"{prefix}{name}": value}
    return flat


# The names of our own files: exported logs, telemetry with and without sensors, MCAP.
ANGLE_PREFIXES = ("angle_rad_", "q_measured_rad_", "q_rad_", "angles/position/")
CURRENT_PREFIXES = {
    "current_command_A_": COMMANDED,
    "current_measured_A_": MEASURED,
    "currents/effort/": COMMANDED,
}


def default(columns: Sequence[str], kind: str | None = None, name: str = "given") -> ColumnMap:
    """Return the column map of a file that this package wrote.

    Parameters
    ----------
    columns : sequence of str
        Names of the columns of the file.
    kind : str, optional
        Kind of the currents, if the file states it.
    name : str
        Of the file, for messages.

    Raises
    ------
    InputError
        The columns have other names.
    """
    angles = [prefix for prefix in ANGLE_PREFIXES if f"{prefix}{ANGLE_NAMES[0]}" in columns]
    currents = [prefix for prefix in CURRENT_PREFIXES if f"{prefix}0" in columns]
    if not (angles and currents):
        raise InputError(
            f"log {name}: expected a column map (--columns MAP.toml), or the columns"
            f" {', '.join(ANGLE_PREFIXES[0] + axis for axis in ANGLE_NAMES)} and"
            f" {next(iter(CURRENT_PREFIXES))}0 to the last group, received"
            f" {', '.join(columns) or 'no column of numbers'}"
        )
    return of_fields(
        {
            "angles": {"columns": [angles[0] + axis for axis in ANGLE_NAMES]},
            "currents": {"columns": [currents[0] + EVERY], "kind": kind or CURRENT_PREFIXES[currents[0]]},
        }
    )
