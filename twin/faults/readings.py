"""Faults of what a sensor says: one line, ``gain · value + offset + noise``, or a held value.

Several on one line act one behind the other, in the order of the plan.
"""

from __future__ import annotations

from collections.abc import Callable

from spheretwin.twin.electronics.sensing.faulty import ENCODER, GAIN, NOISE, OFFSET, SensorFaults
from spheretwin.twin.faults import target
from spheretwin.twin.faults.target import Effects, Mode, Strike, is_held


def modes(
    line: Callable[[Strike], int], unit: str, in_its_own: Callable[[Effects], float] = lambda effects: 1.0
) -> dict[str, Mode]:
    """Ways in which any reading can be wrong.

    Parameters
    ----------
    line : callable
        Line of the part that is struck.
    unit : str
        That a fault's value is told in.
    in_its_own : callable
        What one of it is in the unit of the line.
    """

    def stuck(effects: Effects, strike: Strike) -> None:
        hold(effects.sensors, line(strike), strike, in_its_own(effects))

    def offset(effects: Effects, strike: Strike) -> None:
        shift(effects.sensors, line(strike), strike, in_its_own(effects))

    def gain(effects: Effects, strike: Strike) -> None:
        scale(effects.sensors, line(strike), strike)

    def noise(effects: Effects, strike: Strike) -> None:
        add_noise(effects.sensors, line(strike), strike, in_its_own(effects))

    return {
        "stuck": Mode(stuck, target.held(unit)),
        "offset": Mode(offset, target.offset(unit)),
        "gain": Mode(gain, target.GAIN),
        "noise": Mode(noise, target.noise(unit)),
    }


def fix(sensors: SensorFaults, line: int, value: float) -> None:
    """Let it be one value, in its own unit."""
    _struck(sensors, line)
    sensors.line[line] = (0.0, value, 0.0)


def hold(sensors: SensorFaults, line: int, strike: Strike, unit: float) -> None:
    """Let it stay at a value, told in some unit, or at what it was."""
    _struck(sensors, line)
    if is_held(strike.value):
        sensors.holds[line] = True
    else:
        fix(sensors, line, unit * strike.value)


def shift(sensors: SensorFaults, line: int, strike: Strike, unit: float) -> None:
    """Add a value to it."""
    _struck(sensors, line)
    sensors.line[line, OFFSET] += unit * strike.value


def scale(sensors: SensorFaults, line: int, strike: Strike) -> None:
    """Multiply it, and what was added before."""
    _struck(sensors, line)
    sensors.line[line, GAIN] *= strike.value
    sensors.line[line, OFFSET] *= strike.value
    sensors.line[line, NOISE] *= abs(strike.value)


def add_noise(sensors: SensorFaults, line: int, strike: Strike, unit: float) -> None:
    """Add noise to it; what several faults add is one noise of their root sum of squares."""
    _struck(sensors, line)
    before, more = sensors.line[line, NOISE], unit * strike.value
    sensors.line[line, NOISE] = (before * before + more * more) ** 0.5
    sensors.column[line] = strike.column


def _struck(sensors: SensorFaults, line: int) -> None:
    sensors.acts[1 if line == ENCODER else 0] = True
