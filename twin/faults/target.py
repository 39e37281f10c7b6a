"""What a part that can fail is: its places, and what each mode of failure does to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.twin.electronics.driving.chain import DriveChain
from spheretwin.twin.electronics.sensing.chain import SensorChain

# Far beyond any voltage, current or angle of the electronics; squares of it remain numbers.
LARGEST = 1e6

LARGEST_GAIN = 100.0

AS_IT_WAS = "what it was"


class Value(NamedTuple):
    """What the number of a fault means."""

    meaning: str
    """With its unit."""
    least: float = -LARGEST
    largest: float = LARGEST
    default: float | None = None
    """None where it must be given."""


class Effects(NamedTuple):
    """What faults modify: the stages, in arrays that compiled code reads."""

    drive: DriveChain
    sensors: SensorChain
    group_gain: NDArray[np.float64]  # (n,) torque and back-EMF an ampere over those of the torque matrix
    period_s: float
    step_s: float

    def fault_arrays(self) -> tuple[Any, ...]:
        """Arrays that faults write."""
        return self.drive, self.sensors, self.group_gain


class ActiveFault(NamedTuple):
    """One fault that acts now."""

    place: int
    value: float
    column: int
    """First of two columns of random numbers of its part."""


class Mode(NamedTuple):
    """How a part can fail."""

    apply: Callable[[Effects, ActiveFault], None]
    value: Value | None = None
    """None where it has none."""
    intermittent: bool = False
    """Whether it comes and goes; its value is then the length of a stretch."""


class Target(NamedTuple):
    """One kind of part that can fail."""

    name: str
    modes: Mapping[str, Mode]
    places: tuple[str, ...] = ()
    """Their names; none where there is one part of the kind, or one a group."""
    each_group: bool = False
    needs_supply: bool = False
    """Whether it is there only where the amplifiers have a supply."""
    measured: bool = False
    """True if a fault changes the angles that the controller is handed."""

    def names(self, groups: int) -> tuple[str, ...]:
        """Every part of the kind, as a scenario names it."""
        if self.each_group:
            return tuple(f"{self.name}.{place:02d}" for place in range(groups))
        return tuple(f"{self.name}.{place}" for place in self.places) or (self.name,)


STRETCH = Value("length of a stretch in which it fails or does not, s", 1e-6, 1e3, 0.01)
"""Of what comes and goes: each stretch fails or not, by a fair coin of the seed."""

GAIN = Value("factor on it", -LARGEST_GAIN, LARGEST_GAIN)


def offset(unit: str) -> Value:
    """What is added, in a unit."""
    return Value(f"added to it, {unit}")


def noise(unit: str) -> Value:
    """What is added at random, in a unit."""
    return Value(f"normal noise added to it, {unit} rms, new at each control tick", 0.0)


def held(unit: str) -> Value:
    """What it stays at, in a unit; the last value unless given."""
    return Value(f"what it stays at, {unit}; {AS_IT_WAS} unless given", default=-inf)


def is_held(value: float) -> bool:
    """Whether a value stays what it was."""
    return value == -inf
