"""Fault of a scenario, checked against the parts that can fail and their failure modes."""

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
"""Names of all failure modes; the telemetry numbers them from 1."""

# More groups than any actuator has, and few enough that their names fit in memory.
MOST_GROUPS = 1000

if TYPE_CHECKING:
    ModeName = str
else:
    ModeName = Literal[MODES]

Time = Annotated[float, Field(ge=0, le=LONGEST_s)]


class Fault(BaseModel):
    """Fault: a part that fails for a time."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    target: Annotated[str, Field(min_length=1)] = Field(
        description="part that fails, such as coil.07 (its group), pot.alpha, encoder.gamma, adc, supply"
    )
    mode: ModeName = Field(description="failure mode")
    start_s: Time = Field(0.0, description="start of the fault, s; at the first control tick from then on")
    end_s: Time | None = Field(None, description="end of the fault, s; the end of the run unless given")
    value: float | None = Field(None, description="size of the fault, as its mode defines it")
    reported_to_controller: bool = Field(
        False,
        description="whether the fault is reported to the allocation, which then leaves the group out",
        json_schema_extra={"former": "known"},
    )
    detection: bool = Field(
        False,
        description="whether the fault detector is on, as with detector.detect",
        json_schema_extra={"former": "detect"},
    )

    @model_validator(mode="after")
    def _can_be(self) -> Fault:
        target, _ = find_target(self.target)
        if self.mode not in target.modes:
            raise ValueError(
                f"expected one of {', '.join(target.modes)} for {_one(target)}, received mode {self.mode}"
            )
        self._check_value(target.modes[self.mode])
        if self.end_s is not None and not self.end_s > self.start_s:
            raise ValueError(f"expected end_s above start_s, received {self.end_s!r} and {self.start_s!r} s")
        for name in ("reported_to_controller", "detection"):
            if getattr(self, name) and not target.each_group:
                groups = ", ".join(kind.name for kind in TARGETS.values() if kind.each_group)
                raise ValueError(f"expected {name} for a fault of {groups}, received one of {self.target}")
        return self

    def _check_value(self, mode: Mode) -> None:
        subject = f"{self.mode} of {self.target}"
        if mode.value is None:
            if self.value is not None:
                raise ValueError(f"expected no value for {subject}, received {self.value!r}")
            return
        if self.value is None:
            if mode.value.default is None:
                raise ValueError(f"expected a value for {subject} ({mode.value.meaning}), received none")
            return
        if not mode.value.least <= self.value <= mode.value.largest:
            raise ValueError(
                f"expected a value from {mode.value.least:g} to {mode.value.largest:g} for {subject}"
                f" ({mode.value.meaning}), received {self.value!r}"
            )

    @property
    def kind(self) -> Target:
        """Kind of the part that fails."""
        return find_target(self.target)[0]

    @property
    def place(self) -> int:
        """Index of the part among the parts of its kind."""
        return find_target(self.target)[1]

    @property
    def failure_mode(self) -> Mode:
        """Failure mode of the part."""
        return self.kind.modes[self.mode]

    @property
    def effective_value(self) -> float:
        """Value of the fault: the given one, or the default of the mode."""
        if self.value is not None:
            return self.value
        return self.failure_mode.value.default or 0.0 if self.failure_mode.value else 0.0


def check_gains(faults: Sequence[Fault]) -> None:
    """Check that the product of all gains that act on one part stays small enough to be squared.

    Raises
    ------
    ValueError
        The gains that act on a part at one time have a product above `LARGEST`.
    """
    gains = [fault for fault in faults if fault.mode == "gain"]
    for last in gains:
        product = 1.0
        for fault in gains:
            is_active = fault.start_s <= last.start_s < (inf if fault.end_s is None else fault.end_s)
            if is_active and find_target(fault.target) == find_target(last.target):
                product *= max(abs(fault.effective_value), 1.0)
            if product > LARGEST:
                raise ValueError(
                    f"expected gains of at most {LARGEST:g} in all for faults of {last.target} at"
                    f" {last.start_s:g} s, received a product beyond"
                )


def find_target(name: str) -> tuple[Target, int]:
    """Return kind and index of a part from its name in a scenario.

    Raises
    ------
    ValueError
        No part has this name.
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
    """Return the form of the name of a part."""
    if target.each_group:
        return f"{target.name}.GROUP"
    return " or ".join(target.names(0))


def _one(target: Target) -> str:
    return f"{target.name}.GROUP" if target.each_group else target.name
