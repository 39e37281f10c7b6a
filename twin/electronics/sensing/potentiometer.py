"""Potentiometers of α and β: from the angle of a joint to the voltage of a wiper."""

from __future__ import annotations

from math import cos, pi, sin
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from spheretwin.models.base.compiled import allocation_free
from spheretwin.twin.electronics.fault_line import FaultLine, fault_line, through
from spheretwin.twin.electronics.sensing.stage import Numbers, SensorSetup, SensorStage
from spheretwin.twin.electronics.streams import uniforms

CHANNELS = 2
"""Angles that are voltages on their way: α and β."""

HARMONICS = 4

# The slope of the residual stays below 1, and the voltage rises with the angle everywhere, up to here: with
# amplitudes of 1/k² the slope is at most 2π/E·Σ 1/k, and the peak at least π/4, as |∫f·cos| ≤ 4 max|f| for
# the first harmonic. Of the electrical angle E that leaves 1/(8·Σ 1/k).
LARGEST_SHARE = 0.06


class PotentiometerSection(SensorStage):
    """Potentiometers of α and β; ideal while residual and noise are 0."""

    electrical_angle_rad: Annotated[float, Field(ge=1e-2, le=100)] = Field(
        5 * pi / 3,
        description="angle of the track, centred on 0, at whose ends the wiper stops, rad (assumed: 300°)",
    )
    supply_V: Annotated[float, Field(ge=1e-3, le=1e3)] = Field(
        5.0, description="voltage across the track, centred on 0, V (assumed: the ADC's ±2.5 V)"
    )
    nonlinearity_rad: Annotated[float, Field(ge=0, le=6)] = Field(
        0.0,
        description="largest residual after calibration, four harmonics of the track drawn from the seed, rad"
        " (assumed for the prototype: 0.02°; uncalibrated 5 % of the track, as comparable parts state)",
    )
    noise_rad: Annotated[float, Field(ge=0, le=1)] = Field(
        0.0, description="noise of the wiper, white from conversion to conversion, rad rms (assumed: 0.02°)"
    )

    @model_validator(mode="after")
    def _rises(self) -> PotentiometerSection:
        largest = LARGEST_SHARE * self.electrical_angle_rad
        if not self.nonlinearity_rad < largest:
            raise ValueError(
                f"expected nonlinearity_rad below {largest:.4g} rad, {LARGEST_SHARE:.0%} of"
                " electrical_angle_rad, so that the voltage rises with the angle,"
                f" received {self.nonlinearity_rad:.10g}"
            )
        return self

    @property
    def ideal(self) -> bool:
        """True if the angle comes out as it goes in."""
        return self.nonlinearity_rad == 0 and self.noise_rad == 0

    def build(self, setup: SensorSetup) -> Potentiometers:
        """Potentiometers with residuals of their own; with ends, too, if the converter is not ideal."""
        converts = not (self.ideal and setup.sensors.adc.ideal)
        phases = uniforms(setup.seed, setup.name, CHANNELS, HARMONICS)
        return Potentiometers(
            converts or setup.faults,
            converts,
            self.volts_per_rad,
            (potentiometer(self, phases[0]), potentiometer(self, phases[1])),
            fault_line(CHANNELS),
        )

    @classmethod
    def function(cls) -> Any:
        """Compiled function that takes α and β to the wipers."""
        return pass_potentiometers

    @property
    def volts_per_rad(self) -> float:
        """Slope of the line that the controller takes the track for."""
        return self.supply_V / self.electrical_angle_rad


class Potentiometers(NamedTuple):
    """Both potentiometers, for compiled code."""

    on: bool
    converts: bool  # whether they are more than a line
    volts_per_rad: float
    channels: tuple[Potentiometer, Potentiometer]
    line: FaultLine  # of the wipers, in rad of the nominal slope


@allocation_free
def pass_potentiometers(stage: Potentiometers, measurement: NDArray[np.float64], numbers: Numbers) -> None:
    """Replace α and β by the angles, rad, that the voltages of the wipers stand for."""
    for channel in range(CHANNELS):
        angle = measurement[0, channel]
        if stage.converts:
            angle = wiper_voltage(stage.channels[channel], angle) / stage.volts_per_rad
        measurement[0, channel] = through(stage.line, channel, angle, numbers.faults)


class Potentiometer(NamedTuple):
    """One potentiometer, for compiled code."""

    volts_per_rad: float
    half_angle_rad: float
    half_supply_V: float
    turns: float  # of the first harmonic for a radian of the joint, in rad
    cosine_rad: tuple[float, ...]  # (HARMONICS,) of the residual, from the first harmonic on
    sine_rad: tuple[float, ...]  # (HARMONICS,)


def potentiometer(section: PotentiometerSection, shares: NDArray[np.float64]) -> Potentiometer:
    """Potentiometer with a residual of its own.

    The residual is a sum of the first harmonics of the track, the k-th with an amplitude of 1/k² and a phase
    drawn at random, scaled so that its largest magnitude on the track is the stated one.

    Parameters
    ----------
    section : PotentiometerSection
    shares : (HARMONICS,) array
        Phases of the harmonics as shares of a turn, 0 to 1, drawn for this channel.
    """
    order = np.arange(1, HARMONICS + 1)
    shape = np.exp(1j * (2 * pi * shares)) / order**2
    residual = section.nonlinearity_rad / _peak(shape) * shape
    return Potentiometer(
        section.volts_per_rad,
        section.electrical_angle_rad / 2,
        section.supply_V / 2,
        2 * pi / section.electrical_angle_rad,
        tuple(residual.real.tolist()),
        tuple((-residual.imag).tolist()),
    )


@allocation_free
def wiper_voltage(potentiometer: Potentiometer, angle_rad: float) -> float:
    """Voltage of the wiper (V), without its noise, at an angle of the joint (rad).

    Beyond an end of the track the wiper stands at that end; what is no number stays none.
    """
    half = potentiometer.half_angle_rad
    if angle_rad > half:
        angle_rad = half
    elif angle_rad < -half:
        angle_rad = -half
    # Each harmonic is the first one's turn further than the last.
    first_cosine, first_sine = cos(potentiometer.turns * angle_rad), sin(potentiometer.turns * angle_rad)
    cosine, sine, residual = 1.0, 0.0, 0.0
    for k in range(HARMONICS):
        cosine, sine = cosine * first_cosine - sine * first_sine, sine * first_cosine + cosine * first_sine
        residual += potentiometer.cosine_rad[k] * cosine + potentiometer.sine_rad[k] * sine
    volts = potentiometer.volts_per_rad * (angle_rad + residual)
    if volts > potentiometer.half_supply_V:
        volts = potentiometer.half_supply_V
    elif volts < -potentiometer.half_supply_V:
        volts = -potentiometer.half_supply_V
    return volts


def _peak(shape: NDArray[np.complex128]) -> float:
    """Largest magnitude of ``Re Σ shape[k-1]·exp(ikθ)``: exact, at the roots of its slope.

    With z = exp(iθ) the slope times zⁿ is a polynomial of degree 2n. Roots off the unit circle are no
    extrema, but the sum is taken at their angle, where it is no larger than its peak.
    """
    order = np.arange(1, len(shape) + 1)
    slope = 1j * order * shape
    roots = np.roots(np.concatenate([slope[::-1], [0], slope.conj()]))
    return float(np.abs((np.exp(1j * np.outer(np.angle(roots), order)) @ shape).real).max())
