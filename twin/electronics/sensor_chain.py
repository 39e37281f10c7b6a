"""Sensor chain: the stages from the state of the rotor to the measured angles of the controller.

Each stage maps angles to angles: voltages are stated in radians of the nominal slope. A fault modifies a
stage, by its fault line or by another field. If a converter or a counter is silent, the controller receives
the last angle again, with a flag that it is not new.
"""

from __future__ import annotations

from math import hypot, isfinite, isnan, nan
from typing import Any

import numpy as np
from pydantic import BaseModel, Field, model_validator

from spheretwin.electronics.converters import AdcSection
from spheretwin.electronics.hall_array import HallSection
from spheretwin.electronics.random_streams import Seed, Streams, width_of
from spheretwin.electronics.stages import SensorSetup, SensorStage, TickNoise, chained
from spheretwin.electronics.transducers import CurrentSection, EncoderSection, PotentiometerSection
from spheretwin.models.base.arrays import Array, Integers
from spheretwin.models.base.columns import MixedRowsError
from spheretwin.models.base.compiled import copy_into, inlined
from spheretwin.models.base.record import Record, Rows, field, put, record_of
from spheretwin.trajectories.rounding import CONFIG, Triple


class SensorsSection(BaseModel):
    """Parameters of the sensors; each stage is ideal by default.

    The fields that are a `SensorStage` are the list of the stages, in the order in which angles pass them.
    """

    model_config = CONFIG

    angle_offset_rad: Triple = Field(
        (0.0, 0.0, 0.0), description="constant mounting error of the sensor of each angle, rad"
    )
    potentiometer: PotentiometerSection = PotentiometerSection()
    adc: AdcSection = AdcSection()
    encoder: EncoderSection = EncoderSection()
    current: CurrentSection = CurrentSection()
    hall: HallSection = HallSection()

    @model_validator(mode="after")
    def _measures_once(self) -> SensorsSection:
        if self.hall.on and not self.hinge_sensors_ideal:
            given = [name for name in STAGES if not getattr(self, name).ideal]
            raise ValueError(
                "expected no errors of potentiometer, adc and encoder with sensors.hall, which replaces them,"
                f" received those of {', '.join(given) or 'angle_offset_rad'}"
            )
        return self

    @property
    def ideal(self) -> bool:
        """True if the controller receives the true angles."""
        return self.hinge_sensors_ideal and not self.hall.on

    @property
    def hinge_sensors_ideal(self) -> bool:
        """True if no stage of the sensors of the hinges changes an angle."""
        stages = (getattr(self, name) for name in STAGES)
        return not any(self.angle_offset_rad) and all(stage.ideal for stage in stages)

    @property
    def shifts(self) -> bool:
        """True if any offset or skew is not 0."""
        return any(self.angle_offset_rad) or self.adc.skew_s > 0

    @property
    def draws(self) -> tuple[int, ...]:
        """Standard normal numbers per tick that each stage needs."""
        return tuple(getattr(self, name).draws(self) for name in STAGES)

    @property
    def conversion_noise_V(self) -> float:
        """Noise of one conversion, V rms, of wiper and converter, which are independent."""
        track = self.potentiometer
        return hypot(track.volts_per_rad * track.noise_rad, self.adc.noise_V)

    @property
    def angle_noise_rad(self) -> Triple:
        """Standard deviation of the noise of each angle; with oversampling, of the mean of conversions."""
        if self.hall.on:
            return self.hall.angle_noise_rad
        noise_rad = self.conversion_noise_V / self.potentiometer.volts_per_rad / self.adc.oversampling**0.5
        return noise_rad, noise_rad, 0.0

    @property
    def angle_resolution_rad(self) -> Triple:
        """Step between two values of each angle; 0 for none."""
        step_rad = self.adc.step_V / self.potentiometer.volts_per_rad / self.adc.oversampling
        return step_rad, step_rad, 2 * np.pi / self.encoder.counts if self.encoder.counts else 0.0


STAGES: dict[str, type[SensorStage]] = {
    name: field.annotation
    for name, field in SensorsSection.model_fields.items()
    if isinstance(field.annotation, type) and issubclass(field.annotation, SensorStage)
}
"""Classes of the sensor stages by their names, in the order in which the angles pass them."""


_NAMES = tuple(STAGES)
SensorStages = record_of(
    "SensorStages", "Stages of the sensors.", {n: kind.record for n, kind in STAGES.items()}
)
_pass_stages = chained({name: kind.function() for name, kind in STAGES.items()})


class SensorChain(Record):
    """All angle sensors."""

    offset_rad: Array = field("constant mounting errors", "rad", 3)
    skew_s: Array = field("time of the sample after the tick", "s", 3)
    shifts: bool = field("whether any offset or skew is not 0")
    stages: Any = field("in the order of `STAGES`", family=SensorStages)
    silent: Integers = field("1 if a fault suppresses new angles", "", 3, fault=True)
    fresh: Array = field("1 for a new angle, 0 for a repeated one", "", 3)
    output_rad: Array = field("angles of the last tick; NaN before the first", "rad", 3, state=True)


def fill_sensors(rows: Rows, section: SensorsSection, seed: Seed, faults: bool = False) -> None:
    """Fill sensors with errors drawn from the seed.

    Each stage and channel has its own stream, keyed by its name: no other stage changes its numbers.

    Parameters
    ----------
    rows : array of SensorChain
        In which all numbers are 0.
    section : SensorsSection
    seed : int or (n, 1) array of int
        Seed of the run, or that of each row: the same seed gives the same prototype.
    faults : bool
        Whether a fault may occur.
    """
    put(rows, offset_rad=section.angle_offset_rad, shifts=section.shifts)
    rows["skew_s"][:, 1:2], rows["fresh"], rows["output_rad"] = section.adc.skew_s, 1.0, nan
    first = 0
    for name, width in _draws(section):
        setup = SensorSetup(section, seed, f"sensors.{name}", first, first + width, faults)
        getattr(section, name).fill(rows["stages"][name], setup)
        first += width


def _draws(section: SensorsSection) -> list[tuple[str, int]]:
    """Return the names of the stages and their random numbers per tick, which all rows have."""
    widths = section.draws
    if isinstance(widths, np.ndarray):
        raise MixedRowsError("expected as many random numbers of the sensors in all rows, received others")
    return list(zip(_NAMES, widths, strict=True))


def noise_streams(section: SensorsSection) -> Streams:
    """Return the random streams that `sense` needs, with their widths."""
    stages = tuple((f"sensors.{name} noise", width) for name, width in _draws(section) if width)
    return stages + section.hall.streams


def sensor_sheet(sensors: SensorsSection) -> dict[str, Any]:
    """Return the nominal values of the sensors, by field of `nominal`."""
    return {
        "angle_noise_rad": sensors.angle_noise_rad,
        "angle_resolution_rad": sensors.angle_resolution_rad,
        "current_noise_A": sensors.current.noise_A,
    }


@inlined
def write_telemetry(chain: SensorChain, row: Array) -> None:
    """Write the errors of the angles that are states of the sensors into the beginning of `row`, rad."""
    tracks, encoder = chain.stages.potentiometer, chain.stages.encoder
    copy_into(row, 0, tracks.lead_rad, tracks.lead_rad.shape[0])
    row[2] = 0.0
    if encoder.starts_with_error:
        row[2] = encoder.error_counts * (2 * np.pi / encoder.counts_per_turn)


@inlined
def sense(chain: SensorChain, q: Array, qdot: Array, noise: Array, draws: Array, measurement: Array) -> bool:
    """Write measured angles (rad) and true rates (rad/s) into the first rows of `measurement` (3, 3).

    The measured pose is that at the tick, also for all conversions of an oversampling converter. With a skew
    s of the converter, β is that a time s later, to first order from angle and rate: the error is at most
    ``s**2 / 2`` times the largest acceleration in that time. The controller converts voltages to angles with
    the nominal volts per radian. No sensor measures a rate.

    Parameters
    ----------
    chain : SensorChain
    q, qdot : (3,) arrays, rad and rad/s
        True pose and rates.
    noise : array
        Standard normal numbers of this tick, of the streams of `noise_streams`.
    draws : array
        Standard normal numbers of this tick, of faults.
    measurement : (3, 3) array
        Result.

    Returns
    -------
    bool
        True if all measured values are finite. They are finite if all inputs are, except for angles of γ with
        more counts than a number can represent. NaN is never replaced by a number.
    """
    for i in range(3):
        measurement[0, i], measurement[1, i] = q[i], qdot[i]
        if chain.shifts:
            measurement[0, i] += chain.offset_rad[i] + chain.skew_s[i] * qdot[i]
    _pass_stages(chain.stages, measurement, TickNoise(noise, draws))
    finite = True
    for i in range(3):
        repeats = chain.silent[i] and not isnan(chain.output_rad[i])
        if repeats:
            measurement[0, i] = chain.output_rad[i]
        chain.fresh[i] = 0.0 if repeats else 1.0
        chain.output_rad[i] = measurement[0, i]
        finite = finite and isfinite(measurement[0, i]) and isfinite(measurement[1, i])
    return finite


def measure_again(sensors: Rows, section: SensorsSection, q: Array, noise: Array) -> None:
    """Fill the stored values of new sensors: those that they would have had at the last tick.

    Parameters
    ----------
    sensors : array of SensorChain
    section : SensorsSection
        Section of the sensors.
    q : (3,) array, rad
        Pose at the last tick; empty before the first one.
    noise : array
        Random numbers of the last tick.
    """
    if len(q):
        numbers = width_of(noise_streams(section))
        # Random numbers of sensors with another width do not apply to these.
        last_noise = noise if len(noise) == numbers else np.zeros(numbers)
        for chain in sensors:
            sense(chain, q, np.zeros(3), last_noise, np.zeros(0), np.empty((3, 3)))
