"""The sensors with what is wrong with them; while nothing is, the same bits.

Faults of a potentiometer and of the converter are one line in volts, ``gain · V + offset + noise``, or a
value that is held; those of the encoder the same in radians, before it counts. A converter or a counter that
is silent leaves the controller with the last value, and with the knowledge that it is not new. None of them
knows of a plan: what is wrong now stands in `SensorFaults`, and is written between two control ticks.
"""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import allocation_free
from spheretwin.twin.electronics.sensing import chain
from spheretwin.twin.electronics.sensing.adc import converted
from spheretwin.twin.electronics.sensing.chain import CHANNELS, Sensing
from spheretwin.twin.electronics.sensing.encoder import counted
from spheretwin.twin.electronics.sensing.potentiometer import wiper_voltage

Array = NDArray[np.float64]

ENCODER, ADC = 2, 3
"""Rows of the lines: potentiometers 0 and 1, the encoder, the converter."""

LINES = 4
GAIN, OFFSET, NOISE = 0, 1, 2


class SensorFaults(NamedTuple):
    """What is wrong now, for compiled code; all of it is written from outside but for the last rows."""

    acts: NDArray[np.bool_]  # (2,) whether anything is wrong with α and β, and with γ
    line: Array  # (LINES, 3) gain, offset and rms noise; in volts, the encoder's in rad
    column: NDArray[np.int64]  # (LINES,) of the draws; the converter's second channel has the next one
    holds: NDArray[np.bool_]  # (LINES,) whether a value stays what it was
    silent: NDArray[np.bool_]  # (2,) converter, encoder
    late_ticks: NDArray[np.int64]  # (1,) of the converter
    draws: Array  # standard normal numbers of this tick
    fresh: Array  # (3,) result: 1 where an angle is new, 0 where it is the last one again
    begun: NDArray[np.bool_]  # (1,) whether there is a last tick
    wiper_V: Array  # (2,) of the last tick
    converted_V: Array  # (2,)
    turned_rad: Array  # (1,) of the encoder
    on_the_way_V: Array  # (m, 2) converted, newest at `newest`
    newest: NDArray[np.int64]  # (1,)
    handed_rad: Array  # (3,) to the controller, at the last tick


class FaultySensing(NamedTuple):
    """All sensors and what is wrong with them, for compiled code."""

    sensing: Sensing
    faults: SensorFaults


def sensor_faults(most_late_ticks: int, fresh: Array, draws: Array) -> SensorFaults:
    """Nothing is wrong.

    Parameters
    ----------
    most_late_ticks : int
        Longest delay of the converter that may come.
    fresh : (3,) array
        Written at each tick.
    draws : array
        The loop writes the standard normal numbers of each tick into it.
    """
    made = SensorFaults(
        acts=np.zeros(2, dtype=np.bool_),
        line=np.zeros((LINES, 3)),
        column=np.zeros(LINES, dtype=np.int64),
        holds=np.zeros(LINES, dtype=np.bool_),
        silent=np.zeros(2, dtype=np.bool_),
        late_ticks=np.zeros(1, dtype=np.int64),
        draws=draws,
        fresh=fresh,
        begun=np.zeros(1, dtype=np.bool_),
        wiper_V=np.zeros(2),
        converted_V=np.zeros(2),
        turned_rad=np.zeros(1),
        on_the_way_V=np.zeros((most_late_ticks + 1, 2)),
        newest=np.zeros(1, dtype=np.int64),
        handed_rad=np.zeros(3),
    )
    heal(made)
    return made


def heal(faults: SensorFaults) -> None:
    """Nothing is wrong any more; what is held is let go."""
    faults.acts[:] = False
    faults.line[:], faults.holds[:], faults.silent[:] = (1.0, 0.0, 0.0), False, False
    faults.late_ticks[0] = 0


@allocation_free
def sense(faulty: FaultySensing, q: Array, qdot: Array, noise: Array, measurement: Array) -> bool:
    """Write measured angles and true rates into a measurement, as `chain.sense` does."""
    sensing, faults = faulty.sensing, faulty.faults
    finite = chain.sense(sensing, q, qdot, noise, measurement)
    for channel in range(CHANNELS):
        _sense_channel(faulty, q, noise, measurement, channel)
    _sense_turn(faulty, q, measurement)
    faults.newest[0] = (faults.newest[0] + 1) % faults.on_the_way_V.shape[0]
    faults.begun[0] = True
    for i in range(3):
        faults.handed_rad[i] = measurement[0, i]
        finite = finite and isfinite(measurement[0, i])
    return finite


@allocation_free
def _sense_channel(faulty: FaultySensing, q: Array, noise: Array, measurement: Array, channel: int) -> None:
    """α or β; where nothing is wrong, what the healthy sensors wrote stays."""
    sensing, faults = faulty.sensing, faulty.faults
    potentiometer = sensing.potentiometers[channel]
    ring = faults.on_the_way_V
    place = (faults.newest[0] + 1) % ring.shape[0]
    faults.fresh[channel] = 1.0
    volts = _at_wiper(sensing, q, channel)
    if not faults.acts[0]:
        faults.wiper_V[channel] = volts
        healthy_V = measurement[0, channel] * potentiometer.volts_per_rad
        faults.converted_V[channel] = ring[place, channel] = healthy_V
        return
    volts = _through(faults, channel, volts, faults.wiper_V[channel], 0)
    faults.wiper_V[channel] = volts
    if sensing.in_volts:
        volts = converted(sensing.adcs[channel], volts, sensing.noise_V, noise, channel, CHANNELS)
    volts = _through(faults, ADC, volts, faults.converted_V[channel], channel)
    faults.converted_V[channel] = ring[place, channel] = volts
    if not faults.begun[0]:
        for row in range(ring.shape[0]):
            ring[row, channel] = volts
    volts = ring[(place - faults.late_ticks[0]) % ring.shape[0], channel]
    measurement[0, channel] = volts / potentiometer.volts_per_rad
    if faults.silent[0] and faults.begun[0]:
        measurement[0, channel], faults.fresh[channel] = faults.handed_rad[channel], 0.0


@allocation_free
def _at_wiper(sensing: Sensing, q: Array, channel: int) -> float:
    """Voltage (V) that a healthy wiper has, without its noise."""
    potentiometer, angle = sensing.potentiometers[channel], q[channel] + sensing.offset_rad[channel]
    return wiper_voltage(potentiometer, angle) if sensing.in_volts else potentiometer.volts_per_rad * angle


@allocation_free
def _sense_turn(faulty: FaultySensing, q: Array, measurement: Array) -> None:
    """γ; where nothing is wrong, what the healthy encoder wrote stays."""
    sensing, faults = faulty.sensing, faulty.faults
    faults.fresh[2] = 1.0
    turned = q[2] + sensing.offset_rad[2]
    if faults.acts[1]:
        turned = _through(faults, ENCODER, turned, faults.turned_rad[0], 0)
        measurement[0, 2] = counted(sensing.encoder, turned)
        if faults.silent[1] and faults.begun[0]:
            measurement[0, 2], faults.fresh[2] = faults.handed_rad[2], 0.0
    faults.turned_rad[0] = turned


@allocation_free
def _through(faults: SensorFaults, line: int, value: float, last: float, draw: int) -> float:
    """A value behind a line: scaled, shifted and noisy, or what it was at the last tick."""
    if faults.holds[line] and faults.begun[0]:
        return last
    value = faults.line[line, GAIN] * value + faults.line[line, OFFSET]
    if faults.line[line, NOISE] > 0.0:
        value += faults.line[line, NOISE] * faults.draws[faults.column[line] + draw]
    return value


def state_of(faulty: FaultySensing) -> Array:
    """All that the sensors go on from; what is wrong follows from the plan."""
    faults = faulty.faults
    parts = [faults.begun, faults.wiper_V, faults.converted_V, faults.turned_rad, faults.newest]
    return np.concatenate([*parts, faults.handed_rad, faults.on_the_way_V.ravel()], dtype=np.float64)


def restore(faulty: FaultySensing, state: Array) -> None:
    """Go on from a state of sensors with as many values on their way."""
    faults = faulty.faults
    faults.begun[0], faults.newest[0] = bool(state[0]), int(state[6])
    faults.wiper_V[:], faults.converted_V[:], faults.turned_rad[:] = state[1:3], state[3:5], state[5:6]
    faults.handed_rad[:] = state[7:10]
    faults.on_the_way_V[:] = state[10:].reshape(faults.on_the_way_V.shape)


def carried_on(before: FaultySensing, after: FaultySensing) -> None:
    """Go on as before with other figures; what is on its way repeats its oldest where more is kept now."""
    was, now = before.faults, after.faults
    rows = len(was.on_the_way_V)
    for ago in range(len(now.on_the_way_V)):
        now.on_the_way_V[-1 - ago] = was.on_the_way_V[(was.newest[0] - min(ago, rows - 1)) % rows]
    now.newest[0] = len(now.on_the_way_V) - 1
    now.begun[0], now.turned_rad[:], now.handed_rad[:] = was.begun[0], was.turned_rad, was.handed_rad
    now.wiper_V[:], now.converted_V[:] = was.wiper_V, was.converted_V


def begun(faulty: FaultySensing, q: Array, measured_rad: Array) -> None:
    """Go on from sensors without faults, of which the last pose (3,) and what they made of it are known.

    What is on its way repeats the last value: those before it were not kept.
    """
    sensing, faults = faulty.sensing, faulty.faults
    for channel in range(CHANNELS):
        volts = measured_rad[channel] * sensing.potentiometers[channel].volts_per_rad
        faults.wiper_V[channel] = _at_wiper(sensing, q, channel)
        faults.converted_V[channel] = faults.on_the_way_V[:, channel] = volts
    faults.begun[0], faults.turned_rad[0] = True, q[2] + sensing.offset_rad[2]
    faults.handed_rad[:] = measured_rad
