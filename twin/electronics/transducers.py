"""Transducers: potentiometers of α and β, encoder of γ, current sensors."""

from __future__ import annotations

from math import cos, floor, isnan, nan, pi, sin
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, model_validator

from spheretwin.electronics.random_streams import NORMAL, PHASE, REVERSAL, SMOOTH, UNIFORM, errors, uniforms
from spheretwin.electronics.stages import (
    FaultLine,
    SensorSetup,
    SensorStage,
    TickNoise,
    fill_fault_line,
    through,
)
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import inlined
from spheretwin.models.base.record import Record, Rows, field, put
from spheretwin.trajectories.rounding import CONFIG

CHANNELS = 2
"""Number of angles that are measured as voltages: α and β."""

HARMONICS = 4

# The slope of the residual stays below 1, and the voltage rises with the angle everywhere, up to here: with
# amplitudes of 1/k² the slope is at most 2π/E·Σ 1/k, and the peak at least π/4, as |∫f·cos| ≤ 4 max|f| for
# the first harmonic. Of the electrical angle E that leaves 1/(8·Σ 1/k).
LARGEST_SHARE = 0.06


class Potentiometer(Record):
    """One potentiometer."""

    volts_per_rad: float = field("slope of the straight line", "V/rad")
    half_angle_rad: float = field("half of the track", "rad")
    half_supply_V: float = field("half of the voltage across the track", "V")
    turns: float = field("phase of the first harmonic per radian of the joint", "rad")
    cosine_rad: Array = field("of the residual, from the first harmonic on", "rad", HARMONICS)
    sine_rad: Array = field("of the residual, from the first harmonic on", "rad", HARMONICS)


class Potentiometers(Record):
    """Both potentiometers."""

    on: bool = field("whether the stage changes the angles")
    converts: bool = field("false if they are straight lines")
    volts_per_rad: float = field("slope of the straight line", "V/rad")
    channels: tuple[Potentiometer, ...] = field("of α and β", shape=CHANNELS)
    line: FaultLine = field("of the wipers, in rad of the nominal slope", channels=CHANNELS)
    half_play_rad: float = field("half of the play", "rad")
    repeatability_rad: float = field("largest deviation of the play on a side", "rad")
    first_draw: int = field("first random number")
    wiper_rad: Array = field("angle of the wiper; NaN before the first tick", "rad", CHANNELS, state=True)
    lead_rad: Array = field("lead of the wiper over the joint", "rad", CHANNELS, state=True)
    direction: Array = field("last direction of the wiper", "", CHANNELS, state=True)
    up: Array = field("deviation of the upper play over the repeatability", "", CHANNELS, state=True)
    down: Array = field("deviation of the lower play over the repeatability", "", CHANNELS, state=True)


class PotentiometerSection(SensorStage):
    """Parameters of the potentiometers of α and β; ideal if residual, noise and hysteresis are 0.

    The wiper has play: it rests until the joint has moved by the hysteresis after a reversal. Repeatability
    is the spread of readings at one angle that is approached from one side again and again: the play on each
    side changes at each reversal. The voltage is continuous, as the wiper never jumps.
    """

    record: ClassVar[type[Record]] = Potentiometers

    electrical_angle_rad: Annotated[float, Field(ge=1e-2, le=100)] = Field(
        5 * pi / 3,
        description="angle of the track, centred on 0; the wiper stops at its ends, rad (assumed: 300°)",
    )
    supply_V: Annotated[float, Field(ge=1e-3, le=1e3)] = Field(
        5.0, description="voltage across the track, centred on 0, V (assumed: the ADC's ±2.5 V)"
    )
    nonlinearity_rad: Annotated[float, Field(ge=0, le=6)] = Field(
        0.0,
        description="largest residual after calibration, four harmonics of the track drawn from the seed, rad"
        " (assumed for the prototype: 0.02°; uncalibrated 5 % of the track, as comparable parts state)",
        json_schema_extra=SMOOTH,
    )
    noise_rad: Annotated[float, Field(ge=0, le=1)] = Field(
        0.0,
        description="noise of the wiper, white from conversion to conversion, rad rms (assumed: 0.02°)",
        json_schema_extra=NORMAL,
    )
    hysteresis_rad: Annotated[float, Field(ge=0, le=1)] = Field(
        0.0,
        description="difference between the readings of one angle, approached from below and from above: play"
        " of the wiper, rad",
    )
    repeatability_rad: Annotated[float, Field(ge=0, le=0.5)] = Field(
        0.0,
        description="largest deviation of a reading from the mean of approaches from the same side, new at"
        " each reversal (normal, 3 standard deviations), rad; at most half of hysteresis_rad",
        json_schema_extra=REVERSAL,
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
        if self.repeatability_rad > self.hysteresis_rad / 2:
            raise ValueError(
                "expected repeatability_rad of at most half of hysteresis_rad,"
                f" received {self.repeatability_rad:.10g} and {self.hysteresis_rad:.10g}"
            )
        return self

    @property
    def ideal(self) -> bool:
        """True if the stage does not change the angle."""
        return self.nonlinearity_rad == 0 and self.noise_rad == 0 and self.hysteresis_rad == 0

    def fill(self, rows: Rows, setup: SensorSetup) -> None:
        """Fill the potentiometers, with residuals from the seed; with ends if the converter is not ideal."""
        converts = ~np.logical_and(self.ideal, setup.sensors.adc.ideal)
        put(rows, on=converts | setup.faults, converts=converts, volts_per_rad=self.volts_per_rad)
        put(rows, half_play_rad=self.hysteresis_rad / 2, repeatability_rad=self.repeatability_rad)
        rows["first_draw"], rows["wiper_rad"] = setup.first_draw, nan
        phases = np.zeros((CHANNELS, HARMONICS))
        if np.count_nonzero(self.nonlinearity_rad):
            phases = uniforms(setup.seed, setup.name, CHANNELS, HARMONICS)
        fill_potentiometers(rows["channels"], self, phases)
        fill_fault_line(rows["line"])

    def draws(self, sensors: Any) -> int:
        """Return one number for each channel, used at a reversal; 0 if the play is constant."""
        return CHANNELS if self.repeatability_rad else 0

    @classmethod
    def function(cls) -> Any:
        """Return the compiled function from α and β to the voltages of the wipers."""
        return pass_potentiometers

    @property
    def volts_per_rad(self) -> float:
        """Slope of the straight line that the controller assumes for the track."""
        return self.supply_V / self.electrical_angle_rad


@inlined
def pass_potentiometers(stage: Potentiometers, measurement: Array, noise: TickNoise) -> None:
    """Replace α and β by the angles, rad, of the voltages of the wipers."""
    for channel in range(CHANNELS):
        angle = measurement[0, channel]
        if stage.converts:
            if stage.half_play_rad > 0.0:
                angle = wiper_angle(stage, channel, angle, noise.stages)
            angle = wiper_voltage(stage.channels[channel], angle) / stage.volts_per_rad
        measurement[0, channel] = through(stage.line, channel, angle, noise.faults)


@inlined
def wiper_angle(stage: Potentiometers, channel: int, angle_rad: float, draws: Array) -> float:
    """Return the angle of a wiper (rad) at an angle of its joint (rad), and store it; NaN stays NaN.

    At the first tick the wiper is in the middle of its play.
    """
    spread, last_rad, direction = stage.repeatability_rad, stage.wiper_rad[channel], stage.direction[channel]
    if isnan(angle_rad) or isnan(last_rad):
        stage.wiper_rad[channel] = angle_rad
        return angle_rad
    lowest = angle_rad - (stage.half_play_rad + spread * stage.up[channel])
    highest = angle_rad + (stage.half_play_rad + spread * stage.down[channel])
    wiper = min(max(last_rad, lowest), highest)
    moved = wiper - last_rad
    if moved * direction < 0.0 or (moved != 0.0 and direction == 0.0):
        stage.direction[channel] = 1.0 if moved > 0.0 else -1.0
        if spread > 0.0:  # the play of the next reversal
            deviation = min(max(draws[stage.first_draw + channel] / 3.0, -1.0), 1.0)
            if moved > 0.0:
                stage.down[channel] = deviation
            else:
                stage.up[channel] = deviation
    stage.wiper_rad[channel], stage.lead_rad[channel] = wiper, wiper - angle_rad
    return wiper


def fill_potentiometers(rows: Rows, section: PotentiometerSection, shares: Array) -> None:
    """Fill potentiometers, each with its own residual.

    The residual is a sum of the first harmonics of the track, the k-th with an amplitude of 1/k² and a phase
    drawn at random, scaled so that its largest magnitude on the track is the stated one.

    Parameters
    ----------
    rows : (n, channels) array of Potentiometer
    section : PotentiometerSection
    shares : (channels, HARMONICS) or (n, channels, HARMONICS) array
        Phases of the harmonics as shares of a turn, 0 to 1.
    """
    if np.count_nonzero(section.nonlinearity_rad):
        largest_rad = np.reshape(section.nonlinearity_rad, (-1, 1, 1))
        shape = np.exp(1j * (2 * pi * shares)) / np.arange(1, HARMONICS + 1) ** 2
        residual = largest_rad / _peak(shape) * shape
        harmonics = np.where(largest_rad == 0, 0.0, (residual.real, -residual.imag))
        rows["cosine_rad"], rows["sine_rad"] = harmonics
    rows["volts_per_rad"], rows["half_supply_V"] = section.volts_per_rad, section.supply_V / 2
    rows["half_angle_rad"] = section.electrical_angle_rad / 2
    rows["turns"] = 2 * pi / section.electrical_angle_rad


@inlined
def wiper_voltage(potentiometer: Potentiometer, angle_rad: float) -> float:
    """Return the voltage of the wiper (V), without its noise, at an angle of the joint (rad).

    Beyond an end of the track the wiper is at that end. NaN stays NaN.
    """
    half = potentiometer.half_angle_rad
    if angle_rad > half:
        angle_rad = half
    elif angle_rad < -half:
        angle_rad = -half
    # The phase of each harmonic is that of the previous one plus that of the first.
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


def _peak(shape: NDArray[np.complex128]) -> Array:
    """Return the largest magnitude (…, 1) of ``Re Σ shape[k-1]·exp(ikθ)``: exact, from roots of its slope.

    With z = exp(iθ) the slope times zⁿ is a polynomial of degree 2n. Roots off the unit circle are no
    extrema, but the sum is taken at their angle, where it is no larger than its peak.
    """
    order = np.arange(1, HARMONICS + 1)
    slope = 1j * order * shape
    companion = np.empty((*shape.shape[:-1], 2 * HARMONICS, 2 * HARMONICS), np.complex128)
    companion[...] = np.eye(2 * HARMONICS, k=-1)
    companion[..., 0, : HARMONICS - 1] = -slope[..., -2::-1] / slope[..., -1:]
    companion[..., 0, HARMONICS:] = -slope.conj() / slope[..., -1:]
    angles = np.angle(np.linalg.eigvals(companion))  # as `np.roots`, whose checks take as long
    sums = np.exp(1j * (angles[..., None] * order)) @ shape[..., None]
    return np.abs(sums[..., 0].real).max(axis=-1, keepdims=True)


class Encoder(Record):
    """Encoder of γ."""

    on: bool = field("whether the stage changes the angle")
    counts_per_turn: float = field("0 for none")
    line: FaultLine = field("of the angle, rad, before it is counted", channels=1)
    eccentricity_rad: float = field("amplitude of the error of a disc off its axis", "rad")
    phase_rad: float = field("phase of that error", "rad")
    starts_with_error: bool = field("whether the counter was not referenced before the run")
    index_count: float = field("count of the index")
    error_counts: float = field("error of the counter", state=True)
    turns: float = field("turns from the index at the last tick; NaN before the first", state=True)


class EncoderSection(SensorStage):
    """Parameters of the incremental encoder of γ; ideal if it has neither counts nor eccentricity.

    No count is lost: the counter has the angle to the nearest line of the grid, over any number of turns,
    plus the error that it starts with. The index, once per turn, is one line of the grid. When it passes, the
    counter is set to the angle of the index in this turn, and the error of the start is gone.
    """

    record: ClassVar[type[Record]] = Encoder

    counts: Annotated[int, Field(ge=0, le=2**31)] = Field(
        0,
        description="counts per turn, rounded to the nearest; 0 for none"
        " (assumed: OME-500-2MCA read as 500 pulses × 4 = 2000, 0.18°)",
    )
    eccentricity_rad: Annotated[float, Field(ge=0, le=0.5)] = Field(
        0.0,
        description="amplitude of the error once per turn, of a disc off its axis; its phase is drawn from"
        " the seed, rad (2 × offset / diameter of the grating)",
        json_schema_extra=PHASE,
    )
    start_error_rad: Annotated[float, Field(ge=0, le=pi)] = Field(
        0.0,
        description="largest error of the count until the index passes, drawn from the seed, rad; 0 if the"
        " counter was referenced before the run",
        json_schema_extra=UNIFORM,
    )
    index_rad: Annotated[float, Field(ge=-pi, le=pi)] = Field(
        0.0, description="angle of the index, rounded to a count, rad"
    )

    @model_validator(mode="after")
    def _has_counts(self) -> EncoderSection:
        if self.start_error_rad and not self.counts:
            raise ValueError(
                f"expected counts for a start_error_rad of {self.start_error_rad:.10g}, received 0"
            )
        return self

    @property
    def ideal(self) -> bool:
        """True if the stage does not change the angle."""
        return self.counts == 0 and self.eccentricity_rad == 0

    def fill(self, rows: Rows, setup: SensorSetup) -> None:
        """Fill the encoder, with a phase of the eccentricity and an error of the start from the seed."""
        shares, draws = np.zeros(2), np.logical_or(self.eccentricity_rad, self.start_error_rad)
        if np.count_nonzero(draws):
            shares = np.where(draws, errors(setup.seed, setup.name, 1, 2)[..., 0, :], 0.0)
        phase, start = shares[..., :1], shares[..., 1:]
        put(rows, on=np.logical_not(self.ideal) | setup.faults, counts_per_turn=self.counts, turns=nan)
        put(rows, eccentricity_rad=self.eccentricity_rad, phase_rad=pi * phase)
        put(rows, starts_with_error=np.greater(self.start_error_rad, 0))
        put(rows, index_count=np.rint(self.index_rad * self.counts / (2 * pi)))
        put(rows, error_counts=np.rint(start * self.start_error_rad * self.counts / (2 * pi)))
        fill_fault_line(rows["line"])

    @classmethod
    def function(cls) -> Any:
        """Return the compiled function that counts γ."""
        return pass_encoder


@inlined
def pass_encoder(encoder: Encoder, measurement: Array, noise: TickNoise) -> None:
    """Count γ, rad, after eccentricity and fault line."""
    angle_rad = measurement[0, 2]
    if encoder.eccentricity_rad > 0.0:
        angle_rad += encoder.eccentricity_rad * sin(angle_rad + encoder.phase_rad)
    measurement[0, 2] = counted(encoder, through(encoder.line, 0, angle_rad, noise.faults))
    if encoder.starts_with_error:
        line_rad = 2 * pi / encoder.counts_per_turn
        update_reference(encoder, np.rint(measurement[0, 2] / line_rad))
        measurement[0, 2] += encoder.error_counts * line_rad


@inlined
def update_reference(encoder: Encoder, count: float) -> None:
    """Remove the error of the start if the count is at the index or has passed it since the last tick."""
    turns = (count - encoder.index_count) / encoder.counts_per_turn
    if turns == floor(turns) or abs(floor(turns) - encoder.turns) > 0.0:
        encoder.error_counts = 0.0
    encoder.turns = floor(turns)


@inlined
def counted(encoder: Encoder, angle_rad: float) -> float:
    """Return the angle (rad) of the count nearest to an angle (rad); ties go to the even count.

    NaN stays NaN, and an angle with more counts than a number can represent is infinite.
    """
    if encoder.counts_per_turn == 0:
        return angle_rad
    count = np.rint(angle_rad * (encoder.counts_per_turn / (2 * pi)))
    return count * (2 * pi / encoder.counts_per_turn)


class CurrentSection(BaseModel):
    """Parameters of the current sensors; the fault detector reads them, and the telemetry contains them.

    The sensors exist if they have noise, or if the detector needs them.
    """

    model_config = CONFIG

    noise_A: Annotated[float, Field(ge=0, le=1e3)] = Field(
        0.0,
        description="noise of a sample, A rms (assumed for the prototype: 0.02, a Hall sensor's)",
        json_schema_extra=NORMAL,
    )


class CurrentSensors(Record):
    """Current sensors."""

    on: bool = field("whether the currents are measured")
    noise_A: float = field("standard deviation of the noise", "A")
    measured_A: Array = field("currents at the last control tick", "A", "groups")


@inlined
def sense_currents(sensors: CurrentSensors, current: Array, draws: Array) -> None:
    """Measure the group currents at a control tick.

    Parameters
    ----------
    sensors : CurrentSensors
        Result: the measured currents are written.
    current : (n,) array, A
        True.
    draws : array
        Standard normal numbers, of which the last n are used; none without noise.
    """
    groups, measured = current.shape[0], sensors.measured_A
    first = draws.shape[0] - groups
    for j in range(groups):
        measured[j] = current[j]
        if sensors.noise_A > 0.0:
            measured[j] += sensors.noise_A * draws[first + j]
