"""The converter of the potentiometers' voltages: held together, quantised, averaged."""

from __future__ import annotations

from math import hypot, isnan, nan
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spheretwin.models.base.compiled import allocation_free
from spheretwin.twin.electronics.fault_line import FaultLine, fault_line, through
from spheretwin.twin.electronics.sensing.potentiometer import CHANNELS
from spheretwin.twin.electronics.sensing.stage import Numbers, SensorSetup, SensorStage
from spheretwin.twin.electronics.streams import errors

ERRORS = 2
"""Numbers that are drawn for a channel."""

CONVERSION_s = 4e-6
"""Of the ADS8364: 20 clocks at 5 MHz, from its sheet."""

# What fits into a control period of 1 ms.
MOST_CONVERSIONS = 250


class AdcSection(SensorStage):
    """Analogue-to-digital converter of α and β; ideal while bits, offset, gain error and noise are 0.

    All channels are held at the control tick, the encoder's count with them, and what they hold is converted
    once or several times within the period.
    """

    bits: Annotated[int, Field(ge=0, le=32)] = Field(
        0, description="resolution; 0 for neither steps nor ends (ADS8364's sheet: 16)"
    )
    range_V: Annotated[float, Field(ge=1e-3, le=1e3)] = Field(
        2.5, description="largest input of either sign, V (ADS8364's sheet: ±2.5 V)"
    )
    offset_V: Annotated[float, Field(ge=0, le=1e3)] = Field(
        0.0, description="largest offset; each channel's is drawn from the seed, V (assumed: 1 mV)"
    )
    gain_error: Annotated[float, Field(ge=0, le=0.5)] = Field(
        0.0, description="largest error of the gain; each channel's is drawn from the seed (assumed: 0.1 %)"
    )
    noise_V: Annotated[float, Field(ge=0, le=1e3)] = Field(
        0.0, description="noise of a conversion at the input, V rms (assumed: 1 LSB, 76 µV)"
    )
    oversampling: Annotated[int, Field(ge=1, le=MOST_CONVERSIONS)] = Field(
        1,
        description="conversions averaged in a control period, each with noise of its own, of what is held"
        " (4 µs each by ADS8364's sheet)",
    )

    @property
    def ideal(self) -> bool:
        """True if the voltage comes out as it goes in."""
        return self.bits == 0 and self.offset_V == 0 and self.gain_error == 0 and self.noise_V == 0

    def build(self, setup: SensorSetup) -> Adcs:
        """Channels with errors of their own; they convert if the potentiometers have errors, too."""
        track, late = setup.sensors.potentiometer, setup.most_late_ticks
        converts = not (self.ideal and track.ideal)
        shares = errors(setup.seed, setup.name, CHANNELS, ERRORS)
        return Adcs(
            converts or setup.faults,
            converts,
            track.volts_per_rad,
            (adc(self, shares[0]), adc(self, shares[1])),
            self.input_noise_V(setup.sensors),
            setup.first_draw,
            setup.first_draw + self.draws(setup.sensors),
            fault_line(CHANNELS),
            np.full((late + 1, CHANNELS), nan),
            np.zeros(1, dtype=np.int64),
        )

    @classmethod
    def function(cls) -> Any:
        """Compiled function that converts α and β."""
        return pass_adcs

    def draws(self, sensors: Any) -> int:
        """One number a conversion and channel; none without noise."""
        return CHANNELS * self.oversampling if self.input_noise_V(sensors) else 0

    def input_noise_V(self, sensors: Any) -> float:
        """Noise of one conversion, V rms, of wiper and converter together, which are independent."""
        track = sensors.potentiometer
        return hypot(track.volts_per_rad * track.noise_rad, self.noise_V)

    @property
    def step_V(self) -> float:
        """Voltage of one code; 0 without steps."""
        return 2 * self.range_V / 2**self.bits if self.bits else 0.0


class Adcs(NamedTuple):
    """The converter, for compiled code."""

    on: bool
    converts: bool  # whether its codes are more than a line
    volts_per_rad: float
    channels: tuple[Adc, Adc]
    noise_V: float  # of the wiper and of the conversion together, rms, at the input
    first_draw: int
    end_draw: int
    line: FaultLine  # of what is converted, in rad of the nominal slope
    on_the_way_rad: NDArray[np.float64]  # (m, 2) of the last ticks, newest first; NaN before the first
    late_ticks: NDArray[np.int64]  # (1,) of a fault

    def state_arrays(self) -> tuple[Any, ...]:
        """Arrays that it goes on from."""
        return self.line, self.on_the_way_rad

    def fault_arrays(self) -> tuple[Any, ...]:
        """Arrays that faults write."""
        return self.line, self.late_ticks


@allocation_free
def pass_adcs(stage: Adcs, measurement: NDArray[np.float64], numbers: Numbers) -> None:
    """Replace α and β by the angles, rad, that the controller takes the converted voltages for."""
    for channel in range(CHANNELS):
        angle = measurement[0, channel]
        if stage.converts:
            held_V, draws = stage.volts_per_rad * angle, numbers.noise[stage.first_draw : stage.end_draw]
            volts = converted(stage.channels[channel], held_V, stage.noise_V, draws, channel, CHANNELS)
            angle = volts / stage.volts_per_rad
        angle = through(stage.line, channel, angle, numbers.faults)
        measurement[0, channel] = _delayed(stage, channel, angle)


@allocation_free
def _delayed(stage: Adcs, channel: int, angle: float) -> float:
    """Keep an angle, and return the one of as many ticks ago as a fault delays it, or the first one."""
    ring = stage.on_the_way_rad
    first = isnan(ring[0, channel])
    for row in range(ring.shape[0] - 1, 0, -1):
        ring[row, channel] = angle if first else ring[row - 1, channel]
    ring[0, channel] = angle
    return ring[stage.late_ticks[0], channel]


class Adc(NamedTuple):
    """One channel of the converter, for compiled code."""

    step_V: float  # 0 for none
    lowest: float  # code
    highest: float
    gain: float
    offset_V: float


def adc(section: AdcSection, shares: NDArray[np.float64]) -> Adc:
    """Channel with an offset and a gain of its own.

    Parameters
    ----------
    section : AdcSection
    shares : (`ERRORS`,) array
        Of the largest offset and of the largest error of the gain, -1 to 1, drawn for this channel.
    """
    offset, gain = shares.tolist()
    half = 2.0 ** (section.bits - 1)
    return Adc(
        section.step_V,
        -half,
        half - 1,
        1 + section.gain_error * gain,
        section.offset_V * offset,
    )


@allocation_free
def converted(
    adc: Adc, held_V: float, noise_V: float, draws: NDArray[np.float64], first: int, stride: int
) -> float:
    """Mean voltage (V) that the codes of some conversions stand for.

    Codes are mid-tread: a step of the staircase has its middle at a whole number of LSB, and 0 V is one. They
    end at −2ⁿ⁻¹ and 2ⁿ⁻¹ − 1. What is no number stays none.

    Parameters
    ----------
    adc : Adc
    held_V : float, V
        At the input, the same for all conversions.
    noise_V : float, V
        Standard deviation of all noise at the input; 0 for one conversion, of which others were copies.
    draws : array
        Standard normal numbers: every `stride`-th from `first` on, one a conversion; none without
        noise. With noise, and none of them, there is no voltage.
    first, stride : int
    """
    if noise_V == 0:
        return _code_voltage(adc, held_V)
    total, conversions = 0.0, 0
    for place in range(first, draws.shape[0], stride):
        total += _code_voltage(adc, held_V + noise_V * draws[place])
        conversions += 1
    return total / conversions if conversions else nan


@allocation_free
def _code_voltage(adc: Adc, input_V: float) -> float:
    volts = adc.gain * input_V + adc.offset_V
    if adc.step_V == 0:
        return volts
    code = np.rint(volts / adc.step_V)
    if code > adc.highest:
        code = adc.highest
    elif code < adc.lowest:
        code = adc.lowest
    return code * adc.step_V
