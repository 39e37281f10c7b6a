"""One fault as a scenario plans it, checked against what can fail and how."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from spheretwin.faults.effects import LARGEST, Mode, Target
from spheretwin.faults.targets import TARGETS
from spheretwin.models.base.errors import did_you_mean, shown
from spheretwin.models.telemetry.csv_series import LONGEST_s

MODES = tuple(dict.fromkeys(mode for target in TARGETS.values() for mode in target.modes))
"""Names of all ways in which something can fail; the telemetry counts them from 1."""

# More groups than an actuator has, and fewer than would fill the memory with their names.
MOST_GROUPS = 1000

if TYPE_CHECKING:
    ModeName = str
else:
    ModeName = Literal[MODES]

Time = Annotated[float, Field(ge=0, le=LONGEST_s)]


class Fault(BaseModel):
    """A part that fails for a while."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    target: Annotated[str, Field(min_length=1)] = Field(
        description="what fails, such as coil.07 (its group), pot.alpha, encoder.gamma, adc, supply"
    )
    mode: ModeName = Field(description="how")
    start_s: Time = Field(0.0, description="from when, s; at the first control tick from then on")
    end_s: Time | None = Field(None, description="until when, s; to the end unless given")
    value: float | None = Field(None, description="how much, as the mode has it")
    known: bool = Field(False, description="whether the allocation is told, and leaves the group out")
    detect: bool = Field(
        False, description="whether the controller's detector is on, as detector.detect says"
    )

    @model_validator(mode="after")
    def _can_be(self) -> Fault:
        target, _ = found(self.target)
        if self.mode not in target.modes:
            raise ValueError(
                f"expected one of {', '.join(target.modes)} for {_one(target)}, received mode {self.mode}"
            )
        self._check_value(target.modes[self.mode])
        if self.end_s is not None and not self.end_s > self.start_s:
            raise ValueError(f"expected end_s above start_s, received {self.end_s!r} and {self.start_s!r} s")
        for name in ("known", "detect"):
            if getattr(self, name) and not target.each_group:
                groups = ", ".join(each.name for each in TARGETS.values() if each.each_group)
                raise ValueError(f"expected {name} for a fault of {groups}, received one of {self.target}")
        return self

    def _check_value(self, mode: Mode) -> None:
        what = f"{self.mode} of {self.target}"
        if mode.value is None:
            if self.value is not None:
                raise ValueError(f"expected no value for {what}, received {self.value!r}")
            return
        if self.value is None:
            if mode.value.default is None:
                raise ValueError(f"expected a value for {what} ({mode.value.meaning}), received none")
            return
        if not mode.value.least <= self.value <= mode.value.largest:
            raise ValueError(
                f"expected a value from {mode.value.least:g} to {mode.value.largest:g} for {what}"
                f" ({mode.value.meaning}), received {self.value!r}"
            )

    @property
    def kind(self) -> Target:
        """What fails."""
        return found(self.target)[0]

    @property
    def place(self) -> int:
        """Which one of its kind."""
        return found(self.target)[1]

    @property
    def way(self) -> Mode:
        """How it fails."""
        return self.kind.modes[self.mode]

    @property
    def number(self) -> float:
        """Its value, or what it is where none is given."""
        if self.value is not None:
            return self.value
        return self.way.value.default or 0.0 if self.way.value else 0.0


def check_gains(faults: Sequence[Fault]) -> None:
    """See to it that gains of one part, one behind the other, remain numbers that squares can be taken of.

    Raises
    ------
    ValueError
        Those that act on one part at a time multiply to more than `LARGEST`.
    """
    gains = [fault for fault in faults if fault.mode == "gain"]
    for last in gains:
        product = 1.0
        for fault in gains:
            at_work = fault.start_s <= last.start_s < (inf if fault.end_s is None else fault.end_s)
            if at_work and found(fault.target) == found(last.target):
                product *= max(abs(fault.number), 1.0)
            if product > LARGEST:
                raise ValueError(
                    f"expected gains of at most {LARGEST:g} in all for faults of {last.target} at"
                    f" {last.start_s:g} s, received a product beyond"
                )


def found(name: str) -> tuple[Target, int]:
    """Kind and place of a part that is named as a scenario does.

    Raises
    ------
    ValueError
        There is no such part.
    """
    kind, dot, place = name.partition(".")
    target = TARGETS.get(kind)
    if target is None:
        raise ValueError(
            f"expected one of {', '.join(map(_form, TARGETS.values()))} as target,"
            f" received {shown(name)}{did_you_mean(kind, TARGETS)}"
        )
    if target.each_group:
        if place.isascii() and place.isdecimal() and int(place[:6]) < MOST_GROUPS and len(place) < 6:
            return target, int(place)
    elif target.places:
        if place in target.places:
            return target, target.places.index(place)
    elif not dot:
        return target, 0
    raise ValueError(f"expected {_form(target)} as target, received {shown(name)}")


def _form(target: Target) -> str:
    """How a part of a kind is named."""
    if target.each_group:
        return f"{target.name}.GROUP"
    return " or ".join(target.names(0))


def _one(target: Target) -> str:
    return f"{target.name}.GROUP" if target.each_group else target.name
