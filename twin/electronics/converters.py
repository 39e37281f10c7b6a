"""Digital-to-analogue converter: each channel's command as one of the voltages that it can set.

All channels are set at once (simultaneous latch). A command i is asked for as the voltage i / k, with the
transconductance k of the amplifier behind; the code is the nearest of ``-2**(bits - 1) .. 2**(bits - 1) - 1``
(mid-tread: one code is 0 V), the ends where the command lies beyond. Set is ``LSB code (1 + gain) + offset +
INL(code)``, and the amplifier is asked for k times that.

Integral nonlinearity is a smooth curve a channel, nothing at both ends of the codes, as INL is told against
the straight line through them: ``sum(a_n sin(p) sin(n p))``, a bow, an S and so on, where the codes run from
one end to the other as cos(p). Each term is a polynomial of the code, so that no sine is computed. It stays
within a_n, with a slope of at most ``2 n a_n`` over half the codes: far too little to turn 16 bits back, so
that the converter stays monotonic, as its sheet says.

Settling (20 µs) and glitches are left out: a few hundredths of a physics step.
"""

from __future__ import annotations

from math import hypot, isnan, nan
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spheretwin.electronics.drive_stage import DriveSetup, DriveStage
from spheretwin.electronics.random_streams import errors
from spheretwin.electronics.sensor_stage import Numbers, SensorSetup, SensorStage
from spheretwin.electronics.stages import FaultLine, fault_line, through
from spheretwin.electronics.transducers import CHANNELS
from spheretwin.models.base.compiled import allocation_free, part_of_its_caller

HARMONICS = 3


class DacSection(DriveStage):
    """Converter of the commands, one channel a group; neutral with 0 bits."""

    stage: ClassVar[str] = "dac"
    dac_bits: Annotated[int, Field(ge=0, le=32)] = Field(
        0,
        description="of a code; with 0 the converter is ideal, without range and errors"
        " (AD5370, from its sheet: 16)",
    )
    dac_range_V: Annotated[float, Field(ge=1e-3, le=1e3)] = Field(
        10.0,
        description="output from -range to range, V (span 20 V at a reference of 5 V from the sheet;"
        " that it is centred on 0, assumed)",
    )
    dac_offset_V: Annotated[float, Field(ge=0, le=10)] = Field(
        0.0, description="largest offset of a channel, drawn from the seed, V (assumed: 2e-3)"
    )
    dac_gain_error: Annotated[float, Field(ge=0, le=0.5)] = Field(
        0.0, description="largest relative gain error of a channel, drawn from the seed (assumed: 1e-3)"
    )
    dac_inl_lsb: Annotated[float, Field(ge=0, le=1e4)] = Field(
        0.0,
        description="largest integral nonlinearity of a channel, a smooth curve drawn from the seed, LSB"
        " (assumed: 4)",
    )

    @staticmethod
    def ideal(section: Any) -> bool:
        """True without a converter."""
        return bool(section.dac_bits == 0)

    @staticmethod
    def build(section: Any, setup: DriveSetup) -> Any:
        """Converter in front of amplifiers of the section's transconductance."""
        made = dac(section, section.transconductance_A_V, setup.groups, setup.seed)
        return DacStage(made.converts or setup.faults, made, fault_line(setup.groups * setup.faults, 0.0))

    @staticmethod
    def convert() -> Any:
        """Compiled conversion of a command."""
        return convert_command


class DacStage(NamedTuple):
    """Converter as a stage of the drive."""

    on: bool
    dac: Dac
    line: FaultLine  # of what the amplifiers are asked for, A


@part_of_its_caller
def convert_command(stage: DacStage, setpoint: NDArray[np.float64], draws: NDArray[np.float64]) -> None:
    """Convert a command (n,), A, in its place."""
    convert(stage.dac, setpoint, setpoint)


class Dac(NamedTuple):
    """Converter of a run as compiled code sees it."""

    converts: bool  # whether it is one; if not, a command passes as it is
    transconductance_A_V: float
    span_A: float  # twice what the range is as a current: beyond every code
    lsb_V: float
    lowest: float  # code
    highest: float
    offset_V: NDArray[np.float64]  # (n,)
    gain: NDArray[np.float64]  # (n,) 1 where there is no error
    inl_lsb: NDArray[np.float64]  # (n, HARMONICS) a_n


def dac(section: DacSection, transconductance_A_V: float, groups: int, seed: int) -> Dac:
    """Converter in front of amplifiers of a transconductance (A/V), a channel a group.

    A channel's errors are drawn uniformly within their bounds, INL such that its curve keeps to its bound
    whatever the code. Each channel has its own stream: no field, group or other stage moves what it draws.
    """
    drawn = np.zeros((groups, 2 + HARMONICS))
    if section.dac_bits:  # errors of no converter are not drawn
        drawn = errors(seed, "drive.dac", groups, 2 + HARMONICS)
    harmonics = drawn[:, 2:] / np.maximum(1.0, np.abs(drawn[:, 2:]).sum(axis=1, keepdims=True))
    codes = 2.0**section.dac_bits
    return Dac(
        converts=section.dac_bits > 0,
        transconductance_A_V=transconductance_A_V,
        span_A=2 * section.dac_range_V * transconductance_A_V,
        lsb_V=2 * section.dac_range_V / codes,
        lowest=-codes / 2,
        highest=codes / 2 - 1,
        offset_V=section.dac_offset_V * drawn[:, 0],
        gain=1 + section.dac_gain_error * drawn[:, 1],
        inl_lsb=section.dac_inl_lsb * harmonics,
    )


@allocation_free
def convert(dac: Dac, command: NDArray[np.float64], setpoint: NDArray[np.float64]) -> None:
    """Convert a command.

    It depends on nothing but the command: it may be called when a command comes into force, or once when it
    is computed.

    Parameters
    ----------
    dac : Dac
    command : (n,) array, A
        Any number; beyond the range, and infinity, is its end, and what is not a number stays so.
    asked : (n,) array, A
        Result, what the amplifiers are asked for; may be `command` itself.
    """
    if not dac.converts:
        for j in range(command.shape[0]):
            setpoint[j] = command[j]
        return
    for j in range(command.shape[0]):
        held = min(max(command[j], -dac.span_A), dac.span_A)  # its quotients stay numbers
        code = np.rint(held / dac.transconductance_A_V / dac.lsb_V)
        code = min(max(code, dac.lowest), dac.highest)
        inl = _inl(dac.inl_lsb[j], (2.0 * code + 1.0) / (dac.highest - dac.lowest))
        volts = dac.lsb_V * (code * dac.gain[j] + inl) + dac.offset_V[j]
        setpoint[j] = dac.transconductance_A_V * volts


@allocation_free
def _inl(amplitudes: NDArray[np.float64], place: float) -> float:
    """``sum(a_n sin(p) sin(n p))`` with cos(p) the place of a code, -1 to 1.

    ``sin(n p) / sin(p)`` is Chebyshev's polynomial of the second kind, here by its recurrence.
    """
    total, before, now = 0.0, 0.0, 1.0
    for n in range(amplitudes.shape[0]):
        total += amplitudes[n] * now
        before, now = now, 2.0 * place * now - before
    return (1.0 - place * place) * total


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
