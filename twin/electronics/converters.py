"""Converters: digital-to-analogue of the commands, analogue-to-digital of the measured voltages.

Digital-to-analogue converter: all channels are set at once (simultaneous latch). A command i needs the
voltage i / k, with the transconductance k of the following amplifier. The code is the nearest of ``-2**(bits
- 1) .. 2**(bits - 1) - 1`` (mid-tread: one code is 0 V), limited to these ends. The output is ``LSB code (1 +
gain) + offset + INL(code)``, and the setpoint of the amplifier is k times that.

The integral nonlinearity (INL) of a channel is a smooth curve that is 0 at both end codes, because INL is
defined relative to the straight line through them: ``sum(a_n sin(p) sin(n p))``, a bow, an S and so on, where
cos(p) is the position of the code. Each term is a polynomial of the code, so that no sine is computed. A term
stays within a_n, with a slope of at most ``2 n a_n`` over half the codes. With 16 bits this slope is too
small to reverse a step, so that the converter is monotonic, as its sheet states.

Settling (20 µs) and glitches are neglected: a few hundredths of a physics step.
"""

from __future__ import annotations

from math import isnan, nan
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from spheretwin.electronics.random_streams import NORMAL, SMOOTH, UNIFORM, errors
from spheretwin.electronics.stages import (
    DriveSetup,
    DriveStage,
    FaultLine,
    SensorSetup,
    SensorStage,
    TickNoise,
    fill_fault_line,
    through,
)
from spheretwin.electronics.transducers import CHANNELS
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import inlined
from spheretwin.models.base.history import push
from spheretwin.models.base.record import Record, Rows, field, put

HARMONICS = 3


class Dac(Record):
    """Converter of the commands, one channel for each group."""

    converts: bool = field("false if a command passes unchanged")
    transconductance_A_V: float = field("of the amplifiers that follow", "A/V")
    span_A: float = field("twice the range as a current: beyond every code", "A")
    lsb_V: float = field("voltage of a code", "V")
    lowest: float = field("lowest code")
    highest: float = field("highest code")
    offset_V: Array = field("offset of a channel", "V", "groups")
    gain: Array = field("gain of a channel; 1 without an error", "", "groups")
    inl_lsb: Array = field("amplitudes of the integral nonlinearity", "LSB", ("groups", HARMONICS))


class DacStage(Record):
    """Converter as a stage of the drive."""

    on: bool = field("whether the stage changes a command")
    dac: Dac = field("converter")
    line: FaultLine = field("of the setpoint, A", channels="groups")


class DacSection(DriveStage):
    """Parameters of the converter of the commands, one channel for each group; ideal with 0 bits."""

    stage: ClassVar[str] = "dac"
    record: ClassVar[type[Record]] = DacStage
    dac_bits: Annotated[int, Field(ge=0, le=32)] = Field(
        0,
        description="bits of a code; with 0 the converter is ideal, without range and errors"
        " (AD5370, from its sheet: 16)",
    )
    dac_range_V: Annotated[float, Field(ge=1e-3, le=1e3)] = Field(
        10.0,
        description="output from -range to range, V (span 20 V at a reference of 5 V from the sheet;"
        " assumed: centred on 0)",
    )
    dac_offset_V: Annotated[float, Field(ge=0, le=10)] = Field(
        0.0,
        description="largest offset of a channel, drawn from the seed, V (assumed: 2e-3)",
        json_schema_extra=UNIFORM,
    )
    dac_gain_error: Annotated[float, Field(ge=0, le=0.5)] = Field(
        0.0,
        description="largest relative gain error of a channel, drawn from the seed (assumed: 1e-3)",
        json_schema_extra=UNIFORM,
    )
    dac_inl_lsb: Annotated[float, Field(ge=0, le=1e4)] = Field(
        0.0,
        description="largest integral nonlinearity of a channel, a smooth curve drawn from the seed, LSB"
        " (assumed: 4)",
        json_schema_extra=SMOOTH,
    )

    @staticmethod
    def ideal(section: Any) -> bool:
        """True without a converter."""
        return bool(section.dac_bits == 0)

    @staticmethod
    def fill(rows: Rows, section: Any, setup: DriveSetup) -> None:
        """Fill the converter, for amplifiers of the transconductance of the section."""
        fill_dac(rows["dac"], section, section.transconductance_A_V, setup.seed)
        put(rows, on=np.greater(section.dac_bits, 0) | setup.faults)
        fill_fault_line(rows["line"], 0.0)

    @staticmethod
    def convert() -> Any:
        """Return the compiled conversion of a command."""
        return convert_command


@inlined
def convert_command(stage: DacStage, setpoint: Array, draws: Array) -> None:
    """Convert a command (n,), A, in place."""
    convert(stage.dac, setpoint, setpoint)


def fill_dac(rows: Rows, section: DacSection, transconductance_A_V: float, seed: int) -> None:
    """Fill the converter for amplifiers of a transconductance (A/V), one channel for each group.

    The errors of a channel are drawn uniformly within their bounds; the INL curve stays within its bound for
    every code. Each channel has its own stream: no field, group or other stage changes its numbers.
    """
    groups, converts = rows["gain"].shape[1], np.greater(section.dac_bits, 0)
    drawn = np.zeros((groups, 2 + HARMONICS))
    if np.any(converts):  # an ideal converter needs no numbers
        drawn = np.where(converts[..., None], errors(seed, "drive.dac", groups, 2 + HARMONICS), 0.0)
    curves = drawn[..., 2:]
    harmonics = curves / np.maximum(1.0, np.abs(curves).sum(axis=-1, keepdims=True))
    codes = np.ldexp(1.0, section.dac_bits)
    put(rows, converts=converts, transconductance_A_V=transconductance_A_V)
    put(rows, span_A=2 * section.dac_range_V * transconductance_A_V, lsb_V=2 * section.dac_range_V / codes)
    put(rows, lowest=-codes / 2, highest=codes / 2 - 1)
    put(rows, offset_V=section.dac_offset_V * drawn[..., 0], gain=1 + section.dac_gain_error * drawn[..., 1])
    put(rows, inl_lsb=np.asarray(section.dac_inl_lsb)[..., None] * harmonics)


@inlined
def convert(dac: Dac, command: Array, setpoint: Array) -> None:
    """Convert a command.

    The result depends only on the command: the function may be called when a command becomes active, or once
    when it is computed.

    Parameters
    ----------
    dac : Dac
    command : (n,) array, A
        Any number; values beyond the range are limited, NaN stays NaN.
    asked : (n,) array, A
        Result, setpoint of the amplifiers; may be `command` itself.
    """
    if not dac.converts:
        for j in range(command.shape[0]):
            setpoint[j] = command[j]
        return
    for j in range(command.shape[0]):
        limited = min(max(command[j], -dac.span_A), dac.span_A)  # keeps the quotients finite
        code = np.rint(limited / dac.transconductance_A_V / dac.lsb_V)
        code = min(max(code, dac.lowest), dac.highest)
        inl = _inl(dac.inl_lsb[j], (2.0 * code + 1.0) / (dac.highest - dac.lowest))
        volts = dac.lsb_V * (code * dac.gain[j] + inl) + dac.offset_V[j]
        setpoint[j] = dac.transconductance_A_V * volts


@inlined
def _inl(amplitudes: Array, place: float) -> float:
    """Return ``sum(a_n sin(p) sin(n p))`` with cos(p) the position of a code, -1 to 1.

    ``sin(n p) / sin(p)`` is Chebyshev's polynomial of the second kind, here by its recurrence.
    """
    total, before, now = 0.0, 0.0, 1.0
    for n in range(amplitudes.shape[0]):
        total += amplitudes[n] * now
        before, now = now, 2.0 * place * now - before
    return (1.0 - place * place) * total


ERRORS = 2
"""Random numbers of a channel."""

CONVERSION_s = 4e-6
"""Duration of a conversion of the ADS8364: 20 clocks at 5 MHz, from its sheet."""

# Conversions that fit into a control period of 1 ms.
MOST_CONVERSIONS = 250


class Adc(Record):
    """Channel of the converter of the measured voltages."""

    step_V: float = field("voltage of a code; 0 without steps", "V")
    lowest: float = field("lowest code")
    highest: float = field("highest code")
    gain: float = field("gain; 1 without an error")
    offset_V: float = field("offset at the input", "V")


class Adcs(Record):
    """Converter of the measured voltages."""

    on: bool = field("whether the stage changes the angles")
    converts: bool = field("false if the converter is ideal")
    volts_per_rad: float = field("nominal slope of the tracks", "V/rad")
    channels: tuple[Adc, ...] = field("of α and β", shape=CHANNELS)
    noise_V: float = field("of wiper and conversion together, rms, at the input", "V")
    first_draw: int = field("first random number")
    end_draw: int = field("end of the random numbers")
    line: FaultLine = field("of the converted angle, in rad of the nominal slope", channels=CHANNELS)
    delayed_rad: Array = field(
        "angles of the last ticks, newest first; NaN at first",
        "rad",
        ("delays", CHANNELS),
        state=True,
    )
    delay_ticks: int = field("additional delay of a fault", "control periods", fault=True)


class AdcSection(SensorStage):
    """Parameters of the converter of α and β; ideal if bits, offset, gain error, noise and skew are 0.

    All channels and the count of the encoder are sampled at the control tick, unless there is a skew; the
    samples are converted once or several times within the period.
    """

    record: ClassVar[type[Record]] = Adcs

    bits: Annotated[int, Field(ge=0, le=32)] = Field(
        0, description="resolution; 0 for neither steps nor limits (ADS8364's sheet: 16)"
    )
    range_V: Annotated[float, Field(ge=1e-3, le=1e3)] = Field(
        2.5, description="largest input of either sign, V (ADS8364's sheet: ±2.5 V)"
    )
    offset_V: Annotated[float, Field(ge=0, le=1e3)] = Field(
        0.0,
        description="largest offset; each channel's is drawn from the seed, V (assumed: 1 mV)",
        json_schema_extra=UNIFORM,
    )
    gain_error: Annotated[float, Field(ge=0, le=0.5)] = Field(
        0.0,
        description="largest error of the gain; each channel's is drawn from the seed (assumed: 0.1 %)",
        json_schema_extra=UNIFORM,
    )
    noise_V: Annotated[float, Field(ge=0, le=1e3)] = Field(
        0.0,
        description="noise of a conversion at the input, V rms (assumed: 1 LSB, 76 µV)",
        json_schema_extra=NORMAL,
    )
    oversampling: Annotated[int, Field(ge=1, le=MOST_CONVERSIONS)] = Field(
        1,
        description="conversions averaged in a control period, each with separate noise, of the held sample"
        " (4 µs each by ADS8364's sheet)",
    )
    skew_s: Annotated[float, Field(ge=0, le=1)] = Field(
        0.0,
        description="time between the samples of two channels, α at the tick and β this time later, s; below"
        " controller.period_s (0 for converters with a sample-and-hold for each channel, as the ADS8364)",
    )

    @property
    def ideal(self) -> bool:
        """True if the converter does not change the voltage."""
        errors = (self.bits, self.offset_V, self.gain_error, self.noise_V, self.skew_s)
        return not any(errors)

    def fill(self, rows: Rows, setup: SensorSetup) -> None:
        """Fill the channels, with errors from the seed; they also convert if the tracks have errors."""
        track = setup.sensors.potentiometer
        converts = ~np.logical_and(self.ideal, track.ideal)
        put(rows, on=converts | setup.faults, converts=converts, volts_per_rad=track.volts_per_rad)
        put(rows, noise_V=setup.sensors.conversion_noise_V)
        rows["first_draw"], rows["end_draw"], rows["delayed_rad"] = setup.first_draw, setup.end_draw, nan
        shares, draws = np.zeros((CHANNELS, ERRORS)), np.logical_or(self.offset_V, self.gain_error)
        if np.count_nonzero(draws):
            shares = np.where(draws[..., None], errors(setup.seed, setup.name, CHANNELS, ERRORS), 0.0)
        fill_adcs(rows["channels"], self, shares)
        fill_fault_line(rows["line"])

    @classmethod
    def function(cls) -> Any:
        """Return the compiled function that converts α and β."""
        return pass_adcs

    def draws(self, sensors: Any) -> int:
        """Return one number for each conversion and channel; 0 without noise."""
        return CHANNELS * self.oversampling if sensors.conversion_noise_V else 0

    @property
    def step_V(self) -> float:
        """Voltage of one code; 0 without steps."""
        return 2 * self.range_V / 2**self.bits if self.bits else 0.0


@inlined
def pass_adcs(stage: Adcs, measurement: Array, noise: TickNoise) -> None:
    """Replace α and β by the angles, rad, that the controller computes from the converted voltages."""
    for channel in range(CHANNELS):
        angle = measurement[0, channel]
        if stage.converts:
            held_V, draws = stage.volts_per_rad * angle, noise.stages[stage.first_draw : stage.end_draw]
            volts = converted(stage.channels[channel], held_V, stage.noise_V, draws, channel, CHANNELS)
            angle = volts / stage.volts_per_rad
        angle = through(stage.line, channel, angle, noise.faults)
        measurement[0, channel] = _delayed(stage, channel, angle)


@inlined
def _delayed(stage: Adcs, channel: int, angle: float) -> float:
    """Store an angle and return the one delayed by a fault, or the first angle."""
    history = stage.delayed_rad
    for _ in range(history.shape[0] if isnan(history[0, channel]) else 1):  # the first angle fills all rows
        push(history, channel, angle)
    return history[stage.delay_ticks, channel]


def fill_adcs(rows: Rows, section: AdcSection, shares: Array) -> None:
    """Fill channels, each with its own offset and gain error.

    Parameters
    ----------
    rows : (n, channels) array of Adc
    section : AdcSection
    shares : (channels, `ERRORS`) or (n, channels, `ERRORS`) array
        Shares of the largest offset and of the largest gain error, -1 to 1.
    """
    half = 2.0 ** (section.bits - 1)
    rows["step_V"], rows["lowest"], rows["highest"] = section.step_V, -half, half - 1
    rows["offset_V"] = section.offset_V * shares[..., 0]
    rows["gain"] = 1 + section.gain_error * shares[..., 1]


@inlined
def converted(adc: Adc, held_V: float, noise_V: float, draws: Array, first: int, stride: int) -> float:
    """Return the mean voltage (V) of the codes of some conversions.

    Codes are mid-tread: the middle of a step is a whole number of LSB, and 0 V is a code. The codes are
    limited to −2ⁿ⁻¹ and 2ⁿ⁻¹ − 1. NaN stays NaN.

    Parameters
    ----------
    adc : Adc
    held_V : float, V
        At the input, the same for all conversions.
    noise_V : float, V
        Standard deviation of all noise at the input; with 0 there is one conversion, as all would be equal.
    draws : array
        Standard normal numbers: every `stride`-th from `first` on, one for each conversion; none without
        noise. With noise and without numbers the result is NaN.
    first, stride : int
    """
    if noise_V == 0:
        return _code_voltage(adc, held_V)
    total, conversions = 0.0, 0
    for place in range(first, draws.shape[0], stride):
        total += _code_voltage(adc, held_V + noise_V * draws[place])
        conversions += 1
    return total / conversions if conversions else nan


@inlined
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
