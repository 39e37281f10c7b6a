"""Parts that can fail, their failure modes, and the effects of the modes on signals."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.electronics.drive_chain import DriveChain
from spheretwin.electronics.sensor_chain import SensorChain
from spheretwin.electronics.stages import FaultLine
from spheretwin.models.base.record import Rows

# Far beyond any voltage, current or angle of the electronics; its square remains finite.
LARGEST = 1e6

LARGEST_GAIN = 100.0

LAST_VALUE = "the last value"


class Value(NamedTuple):
    """Meaning and range of the value of a fault."""

    meaning: str
    """With its unit."""
    least: float = -LARGEST
    largest: float = LARGEST
    default: float | None = None
    """None if the value is required."""


class Effects(NamedTuple):
    """Stages that faults modify, in records that compiled code reads."""

    run: Rows  # array of one RunData
    period_s: float
    step_s: float

    @property
    def drive(self) -> DriveChain:
        """Drive of the run."""
        drive: DriveChain = self.run[0].plant.drive
        return drive

    @property
    def sensors(self) -> SensorChain:
        """Sensors of the run."""
        sensors: SensorChain = self.run[0].sensors
        return sensors

    @property
    def group_gain(self) -> NDArray[np.float64]:
        """Torque and back-EMF of each group per ampere over those of the torque matrix, (n,)."""
        gain: NDArray[np.float64] = self.run[0].plant.group_gain
        return gain


class ActiveFault(NamedTuple):
    """A fault that acts at the present tick."""

    place: int
    value: float
    column: int
    """First of the two columns of random numbers of its part."""


class Mode(NamedTuple):
    """Failure mode of a part."""

    apply: Callable[[Effects, ActiveFault], None]
    value: Value | None = None
    """None if the mode has no value."""
    intermittent: bool = False
    """True if the fault is intermittent; its value is then the length of an interval."""


class Target(NamedTuple):
    """Kind of part that can fail."""

    name: str
    modes: Mapping[str, Mode]
    places: tuple[str, ...] = ()
    """Names of the parts; empty if there is one part, or one for each group."""
    each_group: bool = False
    needs_supply: bool = False
    """True if the part exists only if the amplifiers have a supply."""
    measured: bool = False
    """True if a fault changes the angles that the controller receives."""

    def names(self, groups: int) -> tuple[str, ...]:
        """Return the names of all parts of the kind, as in a scenario."""
        if self.each_group:
            return tuple(f"{self.name}.{place:02d}" for place in range(groups))
        return tuple(f"{self.name}.{place}" for place in self.places) or (self.name,)


INTERVAL = Value("length of an interval in which the fault is on or off, s", 1e-6, 1e3, 0.01)
"""Value of an intermittent fault: a random bit of the seed decides each interval."""

GAIN = Value("factor on the signal", -LARGEST_GAIN, LARGEST_GAIN)


def offset_mode(unit: str) -> Value:
    """Return the value of an offset fault, in a unit."""
    return Value(f"offset added to the signal, {unit}")


def noise_mode(unit: str) -> Value:
    """Return the value of a noise fault, in a unit."""
    return Value(f"normal noise added to the signal, {unit} rms, new at each control tick", 0.0)


def stuck_value(unit: str) -> Value:
    """Return the value of a stuck fault, in a unit; default: the last value."""
    return Value(f"value that the signal keeps, {unit}; {LAST_VALUE} unless given", default=-inf)


def keeps_last_value(value: float) -> bool:
    """True if a stuck signal keeps its last value."""
    return value == -inf


class FaultSignal(NamedTuple):
    """A signal that faults act on."""

    line: Callable[[Effects], FaultLine]
    unit: str
    """Unit of the value of a fault."""
    to_line_unit: Callable[[Effects], float] = lambda effects: 1.0
    """Factor from that unit to the unit of the fault line."""
    every_channel: bool = False
    """True if a fault acts on all channels, with separate noise on each; otherwise on that of its place."""


def signal_modes(signal: FaultSignal) -> dict[str, Mode]:
    """Return the failure modes of any signal: stuck, offset, gain, noise."""

    def stuck(effects: Effects, fault: ActiveFault) -> None:
        for line, channel in _channels(signal, effects, fault):
            hold(line, channel, fault.value, signal.to_line_unit(effects))

    def offset(effects: Effects, fault: ActiveFault) -> None:
        for line, channel in _channels(signal, effects, fault):
            line.acts[channel] = 1
            line.offset[channel] += signal.to_line_unit(effects) * fault.value

    def gain(effects: Effects, fault: ActiveFault) -> None:
        for line, channel in _channels(signal, effects, fault):
            scale(line, channel, fault.value)

    def noise(effects: Effects, fault: ActiveFault) -> None:
        for place, (line, channel) in enumerate(_channels(signal, effects, fault)):
            add_noise(line, channel, signal.to_line_unit(effects) * fault.value, fault.column + place)

    return {
        "stuck": Mode(stuck, stuck_value(signal.unit)),
        "offset": Mode(offset, offset_mode(signal.unit)),
        "gain": Mode(gain, GAIN),
        "noise": Mode(noise, noise_mode(signal.unit)),
    }


def silent_modes(signal: FaultSignal) -> dict[str, Mode]:
    """Return the failure modes with a signal of 0: permanent and intermittent."""

    def dropout(effects: Effects, fault: ActiveFault) -> None:
        for line, channel in _channels(signal, effects, fault):
            fix(line, channel, 0.0)

    return {"dropout": Mode(dropout), "intermittent": Mode(dropout, INTERVAL, intermittent=True)}


def fix(line: FaultLine, channel: int, value: float) -> None:
    """Set the channel to a constant value, in the unit of the line."""
    line.acts[channel], line.gain[channel] = 1, 0.0
    line.offset[channel], line.noise[channel] = value, 0.0


def hold(line: FaultLine, channel: int, value: float, unit: float) -> None:
    """Let the channel keep a value, stated in a unit, or its last value."""
    if keeps_last_value(value):
        line.acts[channel] = line.holds[channel] = 1
    else:
        fix(line, channel, unit * value)


def scale(line: FaultLine, channel: int, factor: float) -> None:
    """Multiply the channel and everything that earlier faults added."""
    line.acts[channel] = 1
    line.gain[channel] *= factor
    line.offset[channel] *= factor
    line.noise[channel] *= abs(factor)


def add_noise(line: FaultLine, channel: int, deviation: float, column: int) -> None:
    """Add noise to the channel; noise of several faults adds as the root of the sum of squares."""
    line.acts[channel], line.column[channel] = 1, column
    line.noise[channel] = (line.noise[channel] ** 2 + deviation**2) ** 0.5


def _channels(signal: FaultSignal, effects: Effects, fault: ActiveFault) -> list[tuple[FaultLine, int]]:
    line = signal.line(effects)
    places = range(len(line.acts)) if signal.every_channel else (fault.place,)
    return [(line, channel) for channel in places]
