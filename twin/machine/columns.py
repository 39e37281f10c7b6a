"""Column map: which columns of a file are time, angles and currents, and how raw numbers become SI."""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator, Field, ValidationError, model_validator

from spheretwin.machine.csv_files import CsvFormat
from spheretwin.machine.log import COMMANDED, MEASURED, Log
from spheretwin.machine.raw_table import RawTable, name_list
from spheretwin.machine.row_order import align_rows, row_order
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError, without_breaks
from spheretwin.models.base.files import regular_file
from spheretwin.models.telemetry.joint_states import ANGLE_NAMES
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.scenario.fields import explain
from spheretwin.scenario.plant_sections import Section

Numbers = tuple[float, ...]

EVERY = "*"
"""Part of a name that stands for the numbers from 0 or 1 on that the file has, also with leading zeros."""

ANGLE_UNITS = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180, "turn": 2 * math.pi}
CURRENT_UNITS = {"A": 1.0, "mA": 1e-3}


class TimeColumn(Section):
    """Column of the time."""

    column: str = Field(
        "t_s",
        description="name of the column; in MCAP t_s (stamps of the messages), log_time or publish_time",
    )
    unit: Literal["s", "ms", "us", "ns"] | None = Field(
        None, description="unit of its numbers; unless given, that which the file states, or s"
    )
    wrap: Annotated[float, Field(ge=0)] = Field(
        0.0, description="number after which the clock starts again, such as 4294967296; 0 for none"
    )
    period_s: Annotated[float, Field(gt=0)] | None = Field(
        None, description="interval of the rows of a file without times, s; the column is not read then"
    )


class Channels(Section):
    """Columns of one quantity: ``value = sign * unit * scale * (number - offset)``.

    Each list has an entry for each column, or one entry for all.
    """

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

    unit: tuple[str, ...] = ()
    section: ClassVar[str] = ""

    @model_validator(mode="after")
    def _fits(self) -> Channels:
        if EVERY not in "".join(self.columns):
            for name in ("sign", "scale", "offset", "wrap", "unit"):
                if (count := len(getattr(self, name))) not in (0, 1, len(self.columns)):
                    raise ValueError(
                        f"expected {name} once or for {len(self.columns)} columns, received {count}"
                    )
        if 0 in self.scale:
            raise ValueError("expected a scale other than 0, received 0")
        if min(self.wrap) < 0:
            raise ValueError(f"expected a wrap of at least 0, received {min(self.wrap):g}")
        return self

    def names(self, available: Sequence[str]) -> list[str]:
        """Return the names of the columns in a file with the available ones.

        Raises
        ------
        InputError
            A pattern has a number between others that the file lacks.
        """
        return [
            name for pattern in self.columns for name in (_pattern_columns(pattern, available) or [pattern])
        ]

    def raw(self, table: RawTable) -> Array:
        """Return the numbers of a file, (n, columns).

        Raises
        ------
        InputError
            A column is missing, or has no numbers.
        """
        return np.stack([table.numbers(name) for name in self.names(tuple(table.columns))], axis=1)

    def values(self, table: RawTable, units: Mapping[str, float], raw: Array) -> Array:
        """Return the values of raw numbers of a file, (n, columns).

        Raises
        ------
        InputError
            The file has another number of columns than an entry of the map.
        """
        names = self.names(tuple(table.columns))
        entries = {}
        for field in ("sign", "scale", "offset", "wrap", "unit"):
            given = getattr(self, field)
            if len(given) not in (0, 1, len(names)):
                raise InputError(
                    f"log {table.name}: expected {self.section}.{field} once or for {len(names)} columns,"
                    f" received {len(given)}"
                )
            entries[field] = [*given] * len(names) if len(given) == 1 else given
        entries["unit"] = entries["unit"] or [self._unit(table, name, tuple(units)) for name in names]
        values = raw.copy()
        for place, (offset, wrap) in enumerate(zip(entries["offset"], entries["wrap"], strict=True)):
            if wrap:
                values[:, place] = _unwrap(values[:, place], offset, wrap)
        factors = [units[unit] for unit in entries["unit"]]
        return (
            np.array(entries["sign"])
            * factors
            * np.array(entries["scale"])
            * (values - np.array(entries["offset"]))
        )

    def _unit(self, table: RawTable, name: str, units: Sequence[str]) -> str:
        """Return the unit of a column that the map leaves open; with a scale the file may state any."""
        remedy = f"{self.section}.unit or {self.section}.scale"
        try:
            return table.unit(name, units, remedy) or units[0]
        except InputError:
            if self.scale == (1.0,):
                raise
        return units[0]


def _pattern_columns(pattern: str, available: Sequence[str]) -> list[str]:
    """Return the available names that a pattern stands for, by their numbers; none for a plain name."""
    before, every, after = pattern.partition(EVERY)
    if not every:
        return []
    matches = (re.fullmatch(rf"{re.escape(before)}(\d+){re.escape(after)}", name) for name in available)
    numbered = {int(match[1]): match[0] for match in matches if match}
    if not numbered:
        return [f"{before}0{after}"]
    first = min(numbered)
    expected = range(first if first in (0, 1) else 0, max(numbered) + 1)
    if lacking := [number for number in expected if number not in numbered]:
        raise InputError(
            f"columns {pattern}: expected every number up to {max(numbered)}, received none of"
            f" {before}{lacking[0]}{after}: list the columns in the order of the groups"
        )
    return [numbered[number] for number in expected]


def _unwrap(raw: Array, offset: float, wrap: float) -> Array:
    """Return a continuous count, whose first number is within half a revolution of the offset."""
    values, finite = raw.copy(), np.flatnonzero(np.isfinite(raw))
    if len(finite):
        values[finite] = np.unwrap(raw[finite], period=wrap)
        values -= wrap * np.floor((values[finite[0]] - offset) / wrap + 0.5)
    return values


def _as_tuple(value: Any) -> Any:
    """Return entries, or one, as a tuple."""
    return (value,) if isinstance(value, str) else tuple(value) if isinstance(value, list) else value


class AngleColumns(Channels):
    """Columns of the angles alpha, beta, gamma, in this order."""

    section = "angles"
    unit: Annotated[tuple[Literal["rad", "mrad", "deg", "turn"], ...], BeforeValidator(_as_tuple)] = Field(
        (), description="unit of numbers times scale, or one for each; unless given, that of the file, or rad"
    )

    @model_validator(mode="after")
    def _three(self) -> AngleColumns:
        if len(self.columns) != 3:
            raise ValueError(f"expected columns of three angles, received {len(self.columns)}")
        return self


class CurrentColumns(Channels):
    """Columns of the currents of the coil groups, in their order."""

    section = "currents"
    unit: Annotated[tuple[Literal["A", "mA"], ...], BeforeValidator(_as_tuple)] = Field(
        (), description="unit of numbers times scale, or one for each; unless given, that of the file, or A"
    )
    kind: Literal["commanded", "measured"] = Field(
        "commanded", description="sent to the amplifiers and held, or measured in the coils"
    )


class ColumnMap(Section):
    """Map of a file's columns."""

    csv: CsvFormat = CsvFormat()
    time: TimeColumn = TimeColumn()
    angles: AngleColumns
    currents: CurrentColumns
    conditions: dict[str, Any] = Field(
        default_factory=dict, description="known fields of the scenario during the log"
    )

    def log(self, table: RawTable, accepted: tuple[str, ...] = ()) -> Log:
        """Return the log of a file: rows in the order of time, at the times of the angles.

        Raises
        ------
        InputError
            A column is missing, or has something else than numbers.
        """
        notes: tuple[str, ...] = ()
        if self.time.period_s is None:
            t_s, notes = table.times(self.time.column, self.time.unit, self.time.wrap)
        else:
            t_s = self.time.period_s * np.arange(table.rows, dtype=np.float64)
        angles, currents = self.angles.raw(table), self.currents.raw(table)
        rows, order = row_order(t_s, angles, currents)
        log = Log(
            t_s[rows],
            self.currents.values(table, CURRENT_UNITS, currents[rows]),
            self.angles.values(table, ANGLE_UNITS, angles[rows]),
            self.currents.kind,
            table.name,
            self.conditions,
            accepted,
            (*table.notes, *notes, *order),
        )
        return align_rows(log)


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


# The names of our own files: logs, telemetry with and without sensors, MCAP.
ANGLE_PREFIXES = ("angle_rad_", "q_measured_rad_", "q_rad_", "angles/position/")
CURRENT_PREFIXES = {
    "current_command_A_": COMMANDED,
    "current_measured_A_": MEASURED,
    "currents/effort/": COMMANDED,
    "current_A_": COMMANDED,
}


MCAP_TOPICS = ("angles/", "currents/")


def _scalar_name(name: str) -> str:
    """Return the name of a column as a log has it: without a unit in brackets, with a label as part."""
    match = re.fullmatch(r"(\w+)\[(.+)\]", name)
    label = match[2].removeprefix("group ") if match else ""
    axes = dict(zip(ANGLES, ANGLE_NAMES, strict=True))
    if match and (label in axes or label.isdigit()):
        return f"{match[1]}_{axes.get(label, label)}"
    return re.sub(r"\s*[\[(].*", "", name)


def default(table: RawTable, kind: str | None = None) -> ColumnMap:
    """Return the column map of a file that this package wrote.

    Parameters
    ----------
    table : RawTable
    kind : str, optional
        Kind of the currents, if the file states it.

    Raises
    ------
    InputError
        The columns have other names.
    """
    names = {_scalar_name(name).lower(): name for name in table.columns}
    triples = [[prefix + axis for axis in ANGLE_NAMES] for prefix in ANGLE_PREFIXES]
    triples.append([f"{ANGLE_PREFIXES[0]}{place}" for place in range(3)])
    angles = next((triple for triple in triples if triple[0] in names), None)
    currents = next((prefix for prefix in CURRENT_PREFIXES if f"{prefix}0".lower() in names), None)
    if not (angles and currents):
        raise InputError(
            f"log {table.name}: expected a column map (--columns MAP.toml), or the columns"
            f" {', '.join(ANGLE_PREFIXES[0] + axis for axis in ANGLE_NAMES)} and"
            f" {next(iter(CURRENT_PREFIXES))}0 to the last group, received {name_list(tuple(table.columns))}"
            f"{''.join(f'; {note}' for note in table.notes)}"
        )
    groups = _pattern_columns(currents.lower() + EVERY, tuple(names))
    return of_fields(
        {
            "time": {"column": names.get("t_s", "t_s")},
            "angles": {"columns": [names.get(name, name) for name in angles]},
            "currents": {
                "columns": [names[name] for name in groups],
                "kind": kind or CURRENT_PREFIXES[currents],
            },
        }
    )
