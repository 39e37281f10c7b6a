"""Hall array: sensors on the stator measure the field of rotor and coils, and a filter gives the pose.

A reading is the component of the field along an axis, with offset and gain error drawn from the seed, noise,
the limit of the range and the step of a converter. It replaces potentiometers and encoder: the angles of the
controller are those of `control.estimators.pose_filter`, which knows places, axes and nominal fields, and
the measured currents.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from math import hypot, isfinite, pi
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, Field, model_validator

from spheretwin.control.estimators.pose_filter import (
    FieldGeometry,
    PoseFilter,
    estimate_pose,
    fill_field,
    fill_grid,
)
from spheretwin.electronics.coil import REFERENCE_degC
from spheretwin.electronics.random_streams import NORMAL, UNIFORM, Streams, errors
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import inlined
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.record import Record, Rows, field, put
from spheretwin.models.kinematics import rotation_rows
from spheretwin.models.pole_symmetry import symmetry_rotations, turn_period_rad
from spheretwin.models.scatter import Scatter
from spheretwin.models.stator_field import INTERVALS, check_round_poles, field_of_groups, pole_table
from spheretwin.trajectories.rounding import CONFIG, Triple

MOST = 128
Tesla = Annotated[float, Field(ge=0, le=10)]


class HallSection(BaseModel):
    """Hall sensors on the stator, which measure the pose in place of potentiometers and encoder."""

    model_config = CONFIG

    count: Annotated[int, Field(ge=0, le=MOST)] = Field(
        0, description="sensors, spread evenly over the stator; 0 for those of longitude_deg"
    )
    longitude_deg: Annotated[tuple[Annotated[float, Field(ge=-360, le=360)], ...], Field(max_length=MOST)] = (
        Field((), description="places of the sensors, in place of count: from x towards y, °")
    )
    latitude_deg: Annotated[tuple[Annotated[float, Field(ge=-90, le=90)], ...], Field(max_length=MOST)] = (
        Field((), description="places of the sensors, from the plane of x and y towards z, °")
    )
    highest_deg: Annotated[float, Field(gt=0, le=90)] = Field(
        45.0, description="latitudes of evenly spread sensors, both ways, °"
    )
    radius_m: Annotated[float, Field(ge=1e-3, le=10)] = Field(
        0.085, description="distance of the sensors from the joint centre, m (assumed: behind the coils)"
    )
    axes: Literal["radial", "three"] = Field(
        "radial", description="components that a sensor measures: radial, or also eastward and northward"
    )
    offset_T: Tesla = Field(0.0, description="largest offset of a reading, T", json_schema_extra=UNIFORM)
    gain_error: Annotated[float, Field(ge=0, le=0.5)] = Field(
        0.0, description="largest relative error of the gain of a reading", json_schema_extra=UNIFORM
    )
    noise_T: Tesla = Field(0.0, description="noise of a reading, T rms", json_schema_extra=NORMAL)
    range_T: Annotated[float, Field(gt=0, le=10)] = Field(0.1, description="limit of a reading, both ways, T")
    bits: Annotated[int, Field(ge=0, le=24)] = Field(
        0, description="bits of the converter over the range, both ways; 0 for no steps"
    )
    subtracts_coils: bool = Field(
        True, description="whether the filter subtracts the field of the measured currents"
    )
    start_rad: Triple = Field(
        (0.0, 0.0, 0.0), description="pose near the start: the filter takes the period of γ next to it, rad"
    )
    acceleration_density_rad2_s3: Annotated[float, Field(ge=1e-6, le=1e9)] = Field(
        10.0, description="density of the white acceleration that the filter assumes, rad²/s³"
    )
    remanence_error: Annotated[float, Field(ge=0, le=1)] = Field(
        0.0,
        description="standard deviation of the relative error of the remanence that the filter assumes and"
        " estimates; 0: it is known",
    )
    angle_noise_rad: Triple = Field(
        (5e-4, 5e-4, 5e-4),
        description="standard deviation of the estimated angles in the data sheet of the controller, rad",
    )

    @model_validator(mode="after")
    def _has_places(self) -> HallSection:
        longitudes, latitudes = len(self.longitude_deg), len(self.latitude_deg)
        if longitudes != latitudes or (longitudes and self.count):
            raise ValueError(
                "expected a count, or as many values of longitude_deg as of latitude_deg, received a count of"
                f" {self.count}, {longitudes} and {latitudes} values"
            )
        if self.on and self.readings < 3:
            raise ValueError(f"expected at least three readings for a pose, received {self.readings}")
        return self

    @property
    def on(self) -> bool:
        """True if there are sensors."""
        return self.count > 0 or len(self.longitude_deg) > 0

    @property
    def readings(self) -> int:
        """Number of readings."""
        return (self.count + len(self.longitude_deg)) * (3 if self.axes == "three" else 1)

    @property
    def step_T(self) -> float:
        """Step of the converter; 0 for none."""
        return 2 * self.range_T / 2**self.bits if self.bits else 0.0

    @property
    def streams(self) -> Streams:
        """Random streams of the noise."""
        return (("sensors.hall noise", self.readings),) if self.on else ()

    def directions(self) -> Array:
        """Return the directions of the sensors, (n, 3), stator frame: given, or on a spiral of even steps."""
        if self.count:
            steps = np.arange(self.count)
            sine = np.sin(np.radians(self.highest_deg)) * (1 - (2 * steps + 1) / self.count)
            longitude = steps * pi * (3 - 5**0.5)  # the golden angle
        else:
            sine, longitude = np.sin(np.radians(self.latitude_deg)), np.radians(self.longitude_deg)
        across = np.sqrt(1 - sine**2)
        return np.column_stack([across * np.cos(longitude), across * np.sin(longitude), sine])


class HallArray(Record):
    """Sensors and their filter."""

    geometry: FieldGeometry = field("of the readings")
    pose: PoseFilter = field("filter")
    poles: Array = field("true axes of the poles, rotor frame", "", ("poles", 3))
    strength: Array = field("true remanence over the nominal one, with its sign", "", "poles")
    coils_T_A: Array = field("true field of each group", "T/A", ("readings", "groups"))
    R_SR: Array = field("rotation at the tick", "", (3, 3))
    gain: Array = field("of the readings", "", "readings")
    offset_T: Array = field("of the readings", "T", "readings")
    noise_T: float = field("standard deviation of the noise", "T")
    range_T: float = field("limit of a reading", "T")
    step_T: float = field("step of the converter; 0 for none", "T")
    subtracts: bool = field("whether the filter subtracts the field of the coils")
    reading_T: Array = field("readings of the last tick", "T", "readings")
    no_current_A: Array = field("zeros", "A", "groups")


class _Places(NamedTuple):
    """Geometry of the readings of a section, and their nominal fields."""

    points: Array
    axes: Array
    coils_T_A: Array
    table: Array


def sizes_of(section: HallSection, actuator: Actuator) -> dict[str, int]:
    """Return the sizes of a `HallArray`, except for the number of groups."""
    return {
        "readings": section.readings,
        "poles": len(actuator.pole_axes),
        "table_rows": INTERVALS + 1,
    }


def fill_hall(
    rows: Rows,
    section: HallSection,
    actuator: Actuator,
    scatter: Scatter | None,
    period_s: float,
    seed: int,
) -> None:
    """Fill the array of one run.

    Parameters
    ----------
    rows : array of one HallArray
        In which all numbers are 0.
    section : HallSection
    actuator : Actuator
        Nominal machine.
    scatter : Scatter or None
        True strengths and axes of its poles and coils; their errors of distance do not change the field.
    period_s : float, s
        Control period.
    seed : int

    Raises
    ------
    InputError
        A sensor is within a coil or too close to the magnets, or the poles are not round.
    """
    places = _places_of(section.directions().tobytes(), section.radius_m, section.axes, actuator)
    put(rows["geometry"], points=places.points, axes=places.axes, coils_T_A=places.coils_T_A)
    put(rows["geometry"], poles=actuator.pole_axes, polarity=actuator.pole_polarity, table=places.table)
    put(rows, poles=actuator.pole_axes, strength=actuator.pole_polarity, coils_T_A=places.coils_T_A)
    if scatter is not None:
        poles, coils = scatter.poles, scatter.coils
        put(rows, poles=poles.axes(actuator.pole_axes), strength=actuator.pole_polarity * (1 + poles.gain))
        direction = actuator.coil_direction * (1 + coils.gain)
        true = replace(actuator, coil_axes=coils.axes(actuator.coil_axes), coil_direction=direction)
        put(rows, coils_T_A=_read(field_of_groups(true, places.points * section.radius_m), places.axes))
    shares = errors(seed, "sensors.hall", section.readings, 2)
    put(rows, gain=1 + section.gain_error * shares[:, 0], offset_T=section.offset_T * shares[:, 1])
    put(rows, noise_T=section.noise_T, range_T=section.range_T, step_T=section.step_T)
    put(rows, subtracts=section.subtracts_coils)
    typical_T = float(np.sqrt(np.mean(places.table[:, 0] ** 2)))
    deviation_T = hypot(
        section.noise_T,
        section.step_T / 12**0.5,
        section.offset_T / 3**0.5,
        section.gain_error * typical_T / 3**0.5,
        1e-6 * typical_T,  # of the table
    )
    pose = rows["pose"]
    put(pose, period_s=period_s, variance_T2=deviation_T**2, density=section.acceleration_density_rad2_s3)
    put(pose, remanence_variance=section.remanence_error**2, remanence=1.0)
    rotations = symmetry_rotations(actuator.pole_axes, actuator.pole_polarity)
    fill_grid(pose, actuator.hinge_range_rad, np.array(section.start_rad), turn_period_rad(rotations))


@lru_cache(maxsize=16)
def _places_of(directions: bytes, radius_m: float, components: str, actuator: Actuator) -> _Places:
    """Return the geometry of the readings, from a cache: the rows of a study share it."""
    check_round_poles(actuator)
    table = pole_table(actuator.magnet, radius_m)
    p = np.frombuffer(directions).reshape(-1, 3)
    _check_outside(p * radius_m, actuator)
    points = axes = p
    if components == "three":
        east = np.cross([0.0, 0.0, 1.0], p)
        east = np.where(np.linalg.norm(east, axis=1, keepdims=True) > 1e-9, east, [0.0, 1.0, 0.0])
        east /= np.linalg.norm(east, axis=1, keepdims=True)
        axes = np.stack([p, east, np.cross(p, east)], axis=1).reshape(-1, 3)
        points = np.repeat(p, 3, axis=0)
    fields = field_of_groups(actuator, points * radius_m)
    return _Places(points, axes, _read(fields, axes), table)


def _read(fields: Array, axes: Array) -> Array:
    """Return the components along axes (n, 3), (n, groups), of the fields of groups (groups, n, 3)."""
    return np.asarray(np.einsum("gri,ri->rg", fields, axes))


def _check_outside(points_m: Array, actuator: Actuator) -> None:
    coil = actuator.coil
    along = points_m @ actuator.coil_axes.T
    across = np.sqrt(np.maximum((points_m**2).sum(axis=1)[:, None] - along**2, 0))
    is_within = (np.abs(along - coil.distance_m) <= coil.length_m / 2) & (across <= coil.outer_radius_m)
    is_within &= across >= coil.inner_radius_m
    if np.any(is_within):
        raise InputError(
            f"hall: expected sensors outside the windings, received sensor {np.argwhere(is_within)[0, 0]}"
            " within one; behind all coils are radii of sensors.hall.radius_m above"
            f" {coil.distance_m + coil.length_m / 2:.4g} m"
        )


@inlined
def measure_pose(
    hall: HallArray, q: Array, remanence: float, current_A: Array, measured_A: Array, noise: Array
) -> None:
    """Measure the field in a pose, and estimate the pose from the readings.

    Parameters
    ----------
    hall : HallArray
        Result: its readings and the pose of its filter.
    q : (3,) array, rad
        True pose of the rotor.
    remanence : float
        True remanence over the nominal one.
    current_A, measured_A : (groups,) arrays, A
        True and measured currents.
    noise : array
        Standard normal numbers of this tick, one for each reading.
    """
    geometry, reading_T, pose = hall.geometry, hall.reading_T[:], hall.pose
    for i, row in enumerate(rotation_rows(q)):
        hall.R_SR[i, 0], hall.R_SR[i, 1], hall.R_SR[i, 2] = row
    fill_field(geometry, hall.poles[:], hall.strength[:], hall.R_SR[:], reading_T, pose.slopes_T[:])
    for r in range(reading_T.shape[0]):
        value = remanence * reading_T[r]
        for j in range(current_A.shape[0]):
            value += hall.coils_T_A[r, j] * current_A[j]
        value = hall.gain[r] * value + hall.offset_T[r] + hall.noise_T * noise[r]
        if hall.step_T > 0.0:
            value = hall.step_T * np.rint(value / hall.step_T)
        reading_T[r] = min(max(value, -hall.range_T), hall.range_T)
    estimate_pose(pose, geometry, reading_T, measured_A if hall.subtracts else hall.no_current_A[:])


@inlined
def sense_pose(hall: HallArray, plant: Any, noise: Array, measurement: Array) -> bool:
    """Write the estimated angles (rad) and true rates (rad/s) as `sensor_chain.sense`."""
    heat, currents = plant.parts.heat, plant.current_sensors
    remanence = 1.0
    if heat.on:
        remanence += heat.remanence_per_K * (heat.rotor_degC - REFERENCE_degC)
    measure_pose(hall, plant.rotor.q[:], remanence, plant.current[:], currents.measured_A[:], noise)
    finite = True
    for i in range(3):
        measurement[0, i], measurement[1, i] = hall.pose.q[i], plant.rotor.qdot[i]
        finite = finite and isfinite(measurement[0, i]) and isfinite(measurement[1, i])
    return finite
