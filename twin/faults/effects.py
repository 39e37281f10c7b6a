"""What a part that can fail is: its places, and what each mode of failure does to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.electronics.drive_chain import DriveChain
from spheretwin.electronics.sensor_chain import SensorChain
from spheretwin.electronics.stages import ACTS, COLUMN, HOLDS, NOISE, OFFSET, FaultLine
from spheretwin.electronics.stages import GAIN as LINE_GAIN

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


def offset_mode(unit: str) -> Value:
    """What is added, in a unit."""
    return Value(f"added to it, {unit}")


def noise_mode(unit: str) -> Value:
    """What is added at random, in a unit."""
    return Value(f"normal noise added to it, {unit} rms, new at each control tick", 0.0)


def held(unit: str) -> Value:
    """What it stays at, in a unit; the last value unless given."""
    return Value(f"what it stays at, {unit}; {AS_IT_WAS} unless given", default=-inf)


def is_held(value: float) -> bool:
    """Whether a value stays what it was."""
    return value == -inf


class Signal(NamedTuple):
    """A signal that faults act on."""

    line: Callable[[Effects], FaultLine]
    unit: str
    """Of the value of a fault."""
    in_its_own: Callable[[Effects], float] = lambda effects: 1.0
    """One of that unit in the unit of the line."""
    every_channel: bool = False
    """True if a fault acts on all channels, with noise of its own on each; else on that of its place."""


def modes(signal: Signal) -> dict[str, Mode]:
    """Ways in which any signal can be wrong."""

    def stuck(effects: Effects, fault: ActiveFault) -> None:
        for line, channel in _channels(signal, effects, fault):
            hold(line, channel, fault.value, signal.in_its_own(effects))

    def offset(effects: Effects, fault: ActiveFault) -> None:
        for line, channel in _channels(signal, effects, fault):
            line.table[channel, ACTS] = 1.0
            line.table[channel, OFFSET] += signal.in_its_own(effects) * fault.value

    def gain(effects: Effects, fault: ActiveFault) -> None:
        for line, channel in _channels(signal, effects, fault):
            scale(line, channel, fault.value)

    def noise(effects: Effects, fault: ActiveFault) -> None:
        for place, (line, channel) in enumerate(_channels(signal, effects, fault)):
            add_noise(line, channel, signal.in_its_own(effects) * fault.value, fault.column + place)

    return {
        "stuck": Mode(stuck, held(signal.unit)),
        "offset": Mode(offset, offset_mode(signal.unit)),
        "gain": Mode(gain, GAIN),
        "noise": Mode(noise, noise_mode(signal.unit)),
    }


def silent_modes(signal: Signal) -> dict[str, Mode]:
    """Ways in which a signal can be nothing: for good, or now and then."""

    def dropout(effects: Effects, fault: ActiveFault) -> None:
        for line, channel in _channels(signal, effects, fault):
            fix(line, channel, 0.0)

    return {"dropout": Mode(dropout), "intermittent": Mode(dropout, STRETCH, intermittent=True)}


def fix(line: FaultLine, channel: int, value: float) -> None:
    """Let it be one value, in the unit of the line."""
    line.table[channel, ACTS] = 1.0
    line.table[channel, [LINE_GAIN, OFFSET, NOISE]] = 0.0, value, 0.0


def hold(line: FaultLine, channel: int, value: float, unit: float) -> None:
    """Let it stay at a value, stated in some unit, or at what it was."""
    if is_held(value):
        line.table[channel, [ACTS, HOLDS]] = 1.0
    else:
        fix(line, channel, unit * value)


def scale(line: FaultLine, channel: int, factor: float) -> None:
    """Multiply it, and what was added before."""
    line.table[channel, ACTS] = 1.0
    line.table[channel, [LINE_GAIN, OFFSET]] *= factor
    line.table[channel, NOISE] *= abs(factor)


def add_noise(line: FaultLine, channel: int, deviation: float, column: int) -> None:
    """Add noise to it; what several faults add is one noise of their root sum of squares."""
    line.table[channel, ACTS] = 1.0
    line.table[channel, NOISE] = (line.table[channel, NOISE] ** 2 + deviation**2) ** 0.5
    line.table[channel, COLUMN] = column


def _channels(signal: Signal, effects: Effects, fault: ActiveFault) -> list[tuple[FaultLine, int]]:
    line = signal.line(effects)
    places = range(len(line.table)) if signal.every_channel else (fault.place,)
    return [(line, channel) for channel in places]
