"""From the rotor's state to what the controller is handed: the stages of the angles, one after the other.

Each stage takes angles to angles: voltages are stated in radians of the nominal slope. A fault modifies a
stage, by its fault line or by a field of its own. If a converter or a counter is silent, the controller is
handed the last angle again, and the knowledge that it is not new.
"""

from __future__ import annotations

from math import isfinite, isnan, nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from spheretwin.electronics.converters import AdcSection
from spheretwin.electronics.random_streams import Streams
from spheretwin.electronics.sensor_stage import Numbers, SensorSetup, SensorStage
from spheretwin.electronics.stages import chained
from spheretwin.electronics.transducers import CurrentSection, EncoderSection, PotentiometerSection
from spheretwin.models.base.compiled import allocation_free, transfer_state
from spheretwin.trajectories.rounding import CONFIG, Triple


class SensorsSection(BaseModel):
    """How the controller sees the rotor; each stage is ideal unless told otherwise.

    Its fields that are a `SensorStage` are the list of the stages, in the order in which angles pass them.
    """

    model_config = CONFIG

    angle_offset_rad: Triple = Field(
        (0.0, 0.0, 0.0), description="constant error of each angle, with which its sensor is mounted, rad"
    )
    potentiometer: PotentiometerSection = PotentiometerSection()
    adc: AdcSection = AdcSection()
    encoder: EncoderSection = EncoderSection()
    current: CurrentSection = CurrentSection()

    @property
    def ideal(self) -> bool:
        """True if the controller is handed the true angles."""
        stages = (getattr(self, name) for name in STAGES)
        return not any(self.angle_offset_rad) and all(stage.ideal for stage in stages)


STAGES: dict[str, type[SensorStage]] = {
    name: field.annotation
    for name, field in SensorsSection.model_fields.items()
    if isinstance(field.annotation, type) and issubclass(field.annotation, SensorStage)
}
"""Kinds of the stages of the angles by their names, in the order in which the angles pass them."""


Array = NDArray[np.float64]

_NAMES = tuple(STAGES)
_pass_stages = chained([kind.function() for kind in STAGES.values()])


class SensorChain(NamedTuple):
    """All sensors of the angles, for compiled code."""

    offset_rad: Array  # (3,)
    shifts: bool  # whether any offset is not 0
    stages: tuple[Any, ...]  # in the order of `STAGES`
    silent: NDArray[np.bool_]  # (3,) whether no new angle is handed over, by a fault
    fresh: Array  # (3,) result: 1 where an angle is new, 0 where it is the last one again
    handed_rad: Array  # (3,) to the controller, at the last tick; NaN before the first
    draws: Array  # standard normal numbers of this tick, of faults

    def stage(self, name: str) -> Any:
        """Stage of a name."""
        return self.stages[_NAMES.index(name)]

    def state_arrays(self) -> tuple[Any, ...]:
        """Arrays that it goes on from."""
        return self.stages, self.handed_rad

    def fault_arrays(self) -> tuple[Any, ...]:
        """Arrays that faults write."""
        return self.stages, self.silent


class SensorFaults(NamedTuple):
    """What a chain needs if faults may come."""

    most_late_ticks: int
    """Longest delay of the converter that they may bring."""
    fresh: Array
    """(3,) written at each tick."""
    draws: Array
    """The loop writes the random numbers of each tick into it."""


def sensor_chain(section: SensorsSection, seed: int, faults: SensorFaults | None = None) -> SensorChain:
    """Sensors with errors of their own.

    Each stage and channel draws them from a stream of its own, keyed by its name: no other stage moves one.

    Parameters
    ----------
    section : SensorsSection
    seed : int
        Of the run: the same prototype for the same seed.
    faults : SensorFaults, optional
        None if no fault can come.
    """
    stages, first_draw = [], 0
    for name in _NAMES:
        kind, late = getattr(section, name), faults.most_late_ticks if faults else 0
        setup = SensorSetup(section, seed, f"sensors.{name}", first_draw, faults is not None, late)
        stages.append(kind.build(setup))
        first_draw += kind.draws(section)
    return SensorChain(
        np.array(section.angle_offset_rad, dtype=np.float64),
        any(section.angle_offset_rad),
        tuple(stages),
        np.zeros(3, dtype=np.bool_),
        faults.fresh if faults else np.ones(3),
        np.full(3, nan),
        faults.draws if faults else np.empty(0),
    )


def noise_streams(section: SensorsSection) -> Streams:
    """Random streams that `sense` needs the numbers of, and their widths."""
    widths = ((f"sensors.{name} noise", getattr(section, name).draws(section)) for name in _NAMES)
    return tuple((name, width) for name, width in widths if width)


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
    noise_rad = converter.input_noise_V(section) / track.volts_per_rad / converter.oversampling**0.5
    step_V = 2 * converter.range_V / 2**converter.bits if converter.bits else 0.0
    step_rad = step_V / track.volts_per_rad / converter.oversampling
    count_rad = 2 * np.pi / lines if lines else 0.0
    return (noise_rad, noise_rad, 0.0), (step_rad, step_rad, count_rad)


@allocation_free
def sense(chain: SensorChain, q: Array, qdot: Array, noise: Array, measurement: Array) -> bool:
    """Write measured angles (rad) and true rates (rad/s) into the first rows of `measurement` (3, 3).

    What is measured is the pose at the tick, for all conversions of an oversampling converter too. The
    controller takes voltages back to angles with the nominal volts per radian. No sensor measures a rate.

    Parameters
    ----------
    chain : SensorChain
    q, qdot : (3,) arrays, rad and rad/s
        True.
    noise : array
        Standard normal numbers of this tick, of the streams of `noise_streams`.
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
        if chain.shifts:
            measurement[0, i] += chain.offset_rad[i]
    _pass_stages(chain.stages, measurement, Numbers(noise, chain.draws))
    finite = True
    for i in range(3):
        repeats = chain.silent[i] and not isnan(chain.handed_rad[i])
        if repeats:
            measurement[0, i] = chain.handed_rad[i]
        chain.fresh[i] = 0.0 if repeats else 1.0
        chain.handed_rad[i] = measurement[0, i]
        finite = finite and isfinite(measurement[0, i]) and isfinite(measurement[1, i])
    return finite


def transfer(before: SensorChain, after: SensorChain) -> None:
    """Go on as before with other figures; a stage that was off kept nothing."""
    for was, now in zip(before.stages, after.stages, strict=True):
        if was.on and now.on:
            transfer_state(was, now)
    after.handed_rad[:] = before.handed_rad
