"""Frame format: bytes of a measurement or a command, described in a TOML file."""

from __future__ import annotations

import json
from enum import IntFlag
from importlib import resources
from math import pi
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field, ValidationError, model_validator

from spheretwin.models.base.errors import InputError
from spheretwin.scenario.fields import explain
from spheretwin.scenario.plant_sections import Section
from spheretwin.scenario.reading import read_toml, toml_names

FOLDER = resources.files("spheretwin.machine.link") / "shipped"
DEFAULT_FRAME = "spheretwin"

Byte = Annotated[int, Field(ge=0, le=255)]
MOST_NUMBERS = 1024
"""Largest count of a field: bounds the size of a frame."""

TYPES = ("uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64")


class FrameQuantity(NamedTuple):
    """Quantity that a field can carry."""

    units: dict[str, float]
    """SI value of each unit."""
    numbers: int | Literal["groups"]
    """Numbers of a field unless it states another count."""
    is_integer: bool = False


_ANGLE = {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180}
_RATE = {f"{unit}/s": value for unit, value in _ANGLE.items()}
_COUNT = {"1": 1.0}
QUANTITIES = {
    "sequence": FrameQuantity(_COUNT, 1, True),
    "echo": FrameQuantity(_COUNT, 1, True),
    "flags": FrameQuantity(_COUNT, 1, True),
    "session": FrameQuantity(_COUNT, 1, True),
    "time": FrameQuantity({"s": 1.0, "ms": 1e-3, "us": 1e-6}, 1),
    "angle": FrameQuantity(_ANGLE, 3),
    "rate": FrameQuantity(_RATE, 3),
    "current": FrameQuantity({"A": 1.0, "mA": 1e-3}, "groups"),
    "temperature": FrameQuantity({"degC": 1.0}, 1),
    "unused": FrameQuantity(_COUNT, 1),
}
"""Fields by name. `echo` is the sequence number of the last command that the machine received, `session` the
number that `admission` describes."""


if TYPE_CHECKING:
    FieldName = str
    NumberType = str
else:
    FieldName = Literal[tuple(QUANTITIES)]
    NumberType = Literal[TYPES]


class Flags(IntFlag):
    """Bits of the field `flags`."""

    ARMED = 1
    """Command: apply the currents. Measurement: they were applied."""
    HELLO = 2
    """Command: reply with the present measurement, and do not advance."""
    END = 4
    """The sender ends the run."""
    FAILSAFE = 8
    """Measurement: the machine has switched off its currents."""


class FieldFormat(Section):
    """Field of a frame: numbers of one type."""

    name: FieldName = Field(description="quantity")
    type: NumberType = Field("float64", description="type of each number")
    count: Annotated[int, Field(ge=1, le=MOST_NUMBERS)] | Literal["groups"] | None = Field(
        None, description="numbers; `groups` for one of each coil group; that of the quantity unless given"
    )
    unit: str | None = Field(None, description="unit of scale and offset; SI unless given")
    scale: float = Field(1.0, description="unit per count: value = scale * number + offset")
    offset: float = Field(0.0, description="value of the number 0")

    @model_validator(mode="after")
    def _fits(self) -> FieldFormat:
        quantity = QUANTITIES[self.name]
        if self.unit is not None and self.unit not in quantity.units:
            raise ValueError(
                f"expected the unit of {self.name} as one of {', '.join(quantity.units)},"
                f" received {self.unit}"
            )
        if quantity.is_integer and ("float" in self.type or (self.scale, self.offset) != (1.0, 0.0)):
            raise ValueError(
                f"expected {self.name} as an integer without scale and offset, received {self.type}"
            )
        if self.scale == 0.0:
            raise ValueError(f"expected another scale of {self.name} than 0, received 0")
        return self

    def numbers(self, groups: int) -> int:
        """Return the count for a number of coil groups."""
        count = QUANTITIES[self.name].numbers if self.count is None else self.count
        return groups if count == "groups" else count

    @property
    def si_scale(self) -> float:
        """SI value of one count."""
        return self.scale * self._unit

    @property
    def si_offset(self) -> float:
        """SI value of the number 0."""
        return self.offset * self._unit

    @property
    def _unit(self) -> float:
        return 1.0 if self.unit is None else QUANTITIES[self.name].units[self.unit]


class FrameFormat(Section):
    """Format of the frames of one direction."""

    encoding: Literal["binary", "json"] = Field("binary", description="binary, or one JSON object a line")
    byte_order: Literal["little", "big"] = Field("little", description="of numbers and checksum")
    start: Annotated[tuple[Byte, ...], Field(max_length=16)] = Field((), description="first bytes")
    end: Annotated[tuple[Byte, ...], Field(max_length=16)] = Field((), description="last bytes: terminator")
    checksum: Literal["none", "crc16"] = Field(
        "none",
        description="CRC-16/CCITT-FALSE (polynomial 0x1021, initial value 0xFFFF) of all bytes before it, as"
        " uint16 after the fields; in JSON as the last entry, crc16",
    )
    field: Annotated[tuple[FieldFormat, ...], Field(min_length=1, max_length=64)] = Field(
        description="fields in order, one table [[field]] each"
    )

    @model_validator(mode="after")
    def _fits(self) -> FrameFormat:
        names = [field.name for field in self.field if field.name != "unused"]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"expected each field once, received {', '.join(twice)} twice")
        if self.encoding == "json" and (self.start or self.end):
            raise ValueError("expected JSON without start and end: a line is a frame; received them")
        return self

    def has(self, name: str) -> bool:
        """True if a frame has a field."""
        return any(field.name == name for field in self.field)

    def modulus(self, name: str) -> int:
        """Return the number of values of an integer field; 2³² without the field."""
        sizes = [np.dtype(field.type).itemsize for field in self.field if field.name == name]
        return 256 ** (sizes[0] if sizes else 4)


class MachineFrames(Section):
    """Frames of a machine: what it sends, and what it receives."""

    description: str = Field("", description="machine and purpose")
    currents: Literal["commanded", "measured"] | None = Field(
        None,
        description="currents of a measurement: sent to the amplifiers and held, or measured in the coils",
    )
    measurement: FrameFormat = Field(description="from the machine")
    command: FrameFormat | None = Field(None, description="to the machine; none for one that only reports")

    @model_validator(mode="after")
    def _fits(self) -> MachineFrames:
        if not self.measurement.has("angle"):
            raise ValueError("expected a measurement with the field angle, received one without")
        if self.command and not self.command.has("current"):
            raise ValueError("expected a command with the field current, received one without")
        return self


def shipped() -> list[str]:
    """Return the names of the frame descriptions of the package."""
    return toml_names(FOLDER)


def load(source: str) -> MachineFrames:
    """Read frame formats by a shipped name or from a TOML file.

    Raises
    ------
    InputError
        The file does not exist, or a field is unknown, of the wrong type or out of range.
    """
    fields, _ = read_toml("frame", source, FOLDER)
    try:
        return MachineFrames.model_validate_json(json.dumps(fields, default=str))
    except ValidationError as error:
        raise InputError(f"frame {source}: {explain(error, MachineFrames)}") from None
