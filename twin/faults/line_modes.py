"""Ways in which the fault line of a stage can be wrong: ``gain · value + offset + noise``, or a held value.

Several faults on one line act one behind the other, in the order of the plan; lines follow the order of the
stages.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from spheretwin.twin.electronics.fault_line import ACTS, COLUMN, GAIN, HOLDS, NOISE, OFFSET, FaultLine
from spheretwin.twin.faults import target
from spheretwin.twin.faults.target import STRETCH, ActiveFault, Effects, Mode, is_held


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
        "stuck": Mode(stuck, target.held(signal.unit)),
        "offset": Mode(offset, target.offset(signal.unit)),
        "gain": Mode(gain, target.GAIN),
        "noise": Mode(noise, target.noise(signal.unit)),
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
    line.table[channel, [GAIN, OFFSET, NOISE]] = 0.0, value, 0.0


def hold(line: FaultLine, channel: int, value: float, unit: float) -> None:
    """Let it stay at a value, stated in some unit, or at what it was."""
    if is_held(value):
        line.table[channel, [ACTS, HOLDS]] = 1.0
    else:
        fix(line, channel, unit * value)


def scale(line: FaultLine, channel: int, factor: float) -> None:
    """Multiply it, and what was added before."""
    line.table[channel, ACTS] = 1.0
    line.table[channel, [GAIN, OFFSET]] *= factor
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
