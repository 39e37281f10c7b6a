"""From the rotor's state to what the controller is handed: the stages of each angle, one after the other."""

from __future__ import annotations

from math import hypot, isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import allocation_free
from spheretwin.twin.electronics.sensing import adc as adcs
from spheretwin.twin.electronics.sensing import potentiometer as potentiometers
from spheretwin.twin.electronics.sensing.adc import Adc, adc, converted
from spheretwin.twin.electronics.sensing.encoder import Encoder, counted, encoder
from spheretwin.twin.electronics.sensing.potentiometer import Potentiometer, potentiometer, wiper_voltage
from spheretwin.twin.electronics.sensing.sections import SensorsSection
from spheretwin.twin.electronics.streams import errors, uniforms
from spheretwin.twin.trajectories.trajectory import Triple

CHANNELS = 2
"""Angles that are voltages on their way: α and β."""


class Sensing(NamedTuple):
    """All sensors, for compiled code."""

    offset_rad: NDArray[np.float64]  # (3,)
    potentiometers: tuple[Potentiometer, Potentiometer]
    adcs: tuple[Adc, Adc]
    noise_V: float  # of the wiper and of the conversion together, rms, at the converter's input
    encoder: Encoder
    shifts: bool  # whether any offset is not 0
    in_volts: bool  # whether potentiometers or converter are more than a line
    ideal: bool  # whether all angles are handed over as they are


def sensing(section: SensorsSection, seed: int) -> Sensing:
    """Sensors with errors of their own.

    Each stage and channel draws them from a stream of its own: one that is switched on moves no other's.

    Parameters
    ----------
    section : SensorsSection
    seed : int
        Of the run: the same prototype for the same seed.
    """
    track, converter = section.potentiometer, section.adc
    phases = uniforms(seed, potentiometers.STAGE, CHANNELS, potentiometers.HARMONICS)
    shares = errors(seed, adcs.STAGE, CHANNELS, adcs.ERRORS)
    return Sensing(
        np.array(section.angle_offset_rad, dtype=np.float64),
        (potentiometer(track, phases[0]), potentiometer(track, phases[1])),
        (adc(converter, shares[0]), adc(converter, shares[1])),
        _noise_V(section),
        encoder(section.encoder),
        any(section.angle_offset_rad),
        not (track.ideal and converter.ideal),
        section.ideal,
    )


def noise_width(section: SensorsSection) -> int:
    """Standard normal numbers that `sense` needs a tick; 0 without noise."""
    return CHANNELS * section.adc.oversampling if _noise_V(section) else 0


def accuracy(section: SensorsSection) -> tuple[Triple, Triple]:
    """Return noise and resolution of the three measured angles.

    Returns
    -------
    tuple of 3 floats, rad
        Standard deviation of the noise of each; with oversampling, of the mean of all conversions.
    tuple of 3 floats, rad
        Step between two values that each can have; 0 for none.
    """
    track, converter, lines = section.potentiometer, section.adc, section.encoder.counts
    noise_rad = _noise_V(section) / track.volts_per_rad / converter.oversampling**0.5
    step_V = 2 * converter.range_V / 2**converter.bits if converter.bits else 0.0
    step_rad = step_V / track.volts_per_rad / converter.oversampling
    count_rad = 2 * np.pi / lines if lines else 0.0
    return (noise_rad, noise_rad, 0.0), (step_rad, step_rad, count_rad)


@allocation_free
def sense(
    sensing: Sensing,
    q: NDArray[np.float64],
    qdot: NDArray[np.float64],
    noise: NDArray[np.float64],
    measurement: NDArray[np.float64],
) -> bool:
    """Write measured angles (rad) and true rates (rad/s) into the first rows of `measurement` (3, 3).

    What is measured is the pose at the tick, for all conversions of an oversampling converter too. The
    controller takes voltages back to angles with the nominal volts per radian. No sensor measures a rate.

    Parameters
    ----------
    sensing : Sensing
    q, qdot : (3,) arrays, rad and rad/s
        True.
    noise : (`noise_width`,) array
        Standard normal numbers of this tick: α and β by turns, a pair for each conversion.
    measurement : (3, 3) array
        Result.

    Returns
    -------
    bool
        Whether all that is handed over is finite. It is where all that goes in is, up to angles of γ with
        more counts than a number can hold; what is no number is never made one.
    """
    for i in range(3):
        measurement[0, i], measurement[1, i] = q[i], qdot[i]
    if not sensing.ideal:
        if sensing.shifts:
            for i in range(3):
                measurement[0, i] += sensing.offset_rad[i]
        if sensing.in_volts:
            for channel in range(CHANNELS):
                potentiometer = sensing.potentiometers[channel]
                held_V = wiper_voltage(potentiometer, measurement[0, channel])
                volts = converted(sensing.adcs[channel], held_V, sensing.noise_V, noise, channel, CHANNELS)
                measurement[0, channel] = volts / potentiometer.volts_per_rad
        measurement[0, 2] = counted(sensing.encoder, measurement[0, 2])
    finite = True
    for i in range(3):
        finite = finite and isfinite(measurement[0, i]) and isfinite(measurement[1, i])
    return finite


def _noise_V(section: SensorsSection) -> float:
    """Of one conversion: the sum of two independent normal numbers is one of their root sum of squares."""
    track = section.potentiometer
    return hypot(track.volts_per_rad * track.noise_rad, section.adc.noise_V)
