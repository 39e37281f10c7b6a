"""Faults of what a sensor says: one line, ``gain · value + offset + noise``, or a held value.

Several on one line act one behind the other, in the order of the plan.
"""

from __future__ import annotations

from spheretwin.twin.electronics.sensing.faulty import ENCODER, GAIN, NOISE, OFFSET, SensorFaults
from spheretwin.twin.faults.target import Strike, is_held


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
