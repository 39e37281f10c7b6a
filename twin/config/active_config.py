"""Active configuration of a session: resolved scenario, its files, user law and user trajectory."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from spheretwin.control.law import Law
from spheretwin.control.law_components.parameters import COMPENSATORS
from spheretwin.control.laws import LAWS
from spheretwin.electronics.coil_coupling import check_coupling
from spheretwin.electronics.drive_section import DriveSection, ResolvedDrive, drive_sheet
from spheretwin.electronics.sensor_chain import SensorsSection, sensor_sheet
from spheretwin.faults.fault import Fault
from spheretwin.loop import assembly
from spheretwin.models import mjcf
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError, distinct_texts, shown
from spheretwin.models.base.reuse import reused
from spheretwin.models.base.user_code import is_reference
from spheretwin.models.coil_group import per_group
from spheretwin.models.inductance import mutual_inductance
from spheretwin.models.lagrangian import loaded_inertia
from spheretwin.models.mjcf import Mjcf
from spheretwin.models.mjcf_reader import HINGES
from spheretwin.models.telemetry.run_record import Change
from spheretwin.models.telemetry.signals import Signal, with_more
from spheretwin.models.torque_field import TorqueField
from spheretwin.plant.end_stops import EndStopsSection
from spheretwin.plant.magnet_heat import ResolvedThermal, ThermalSection
from spheretwin.scenario.changes import with_change
from spheretwin.scenario.files import Files, files_of, nominal_curve, reload_files
from spheretwin.scenario.hardware import (
    HARDWARE,
    PER_GROUP,
    SCATTER_OF_A_CURVE,
    amplifier_limit_A,
    machine_values,
)
from spheretwin.scenario.plant_sections import NominalSection, PlantSection, ResolvedNominal, ResolvedPlant
from spheretwin.scenario.reading import as_plain
from spheretwin.scenario.sections import ResolvedScenario, Scenario, UserController, UserPath
from spheretwin.trajectories import SHAPES
from spheretwin.trajectories.rounding import Triple
from spheretwin.trajectories.trajectory import Sampled, UserTrajectory, checked


def fill_defaults(
    scenario: Scenario, files: Files, law: Law | None, trajectory: UserTrajectory | None
) -> ResolvedScenario:
    """Return a scenario with every default filled in, from its files, its trajectory and its hardware.

    Raises
    ------
    InputError
        The first pose is outside the range of the hinges, a list does not fit the actuator, or the law is for
        another control period.
    """
    actuator, section = files.actuator, _applicable(scenario, files.actuator)
    _check_groups(scenario, actuator)
    drive = _drive(scenario.drive, actuator, scenario.hardware)
    heat = machine_values(actuator, scenario.hardware, "plant.thermal")
    if section.thermal.on and drive.supply_V is None:
        raise InputError("scenario: expected a drive.supply_V with plant.thermal.on, received none")
    if drive.coil_coupling:
        check_coupling(drive, mutual_inductance(actuator))
    plant = _with(
        ResolvedPlant,
        section,
        initial_rad=section.initial_rad
        or (_first_pose(trajectory) if trajectory else _shipped_first_pose(scenario.trajectory)),
        gravity_m_s2=_gravity(section, files.model),
        thermal=_thermal(section.thermal, heat),
        group_gain=section.group_gain or (1.0,) * len(actuator.groups),
        end_stops=_end_stops(section.end_stops),
    )
    resolved = _with(
        ResolvedScenario, scenario, drive=drive, plant=plant, nominal=_nominal(scenario, drive, actuator)
    )
    if law:
        law.check_period(scenario.controller.period_s)
        controller = UserController(
            law=name_of_user_object(law.name),
            period_s=scenario.controller.period_s,
            parameters=tuple(law.parameters.tolist()),
            **scenario.controller.compensators,
        )
        resolved = resolved.model_copy(update={"controller": controller})
    if trajectory:
        resolved = resolved.model_copy(
            update={"trajectory": UserPath(shape=name_of_user_object(trajectory.name))}
        )
    check_pose(plant.initial_rad, actuator)
    _check_faults(resolved.fault, actuator)
    return resolved


def _applicable(scenario: Scenario, actuator: Actuator) -> PlantSection:
    """Return the plant without the errors of the hardware set that its machine cannot have."""
    plant = scenario.plant
    for dotted in inapplicable(scenario, actuator):
        _, section, name = dotted.split(".")
        scatter = getattr(plant, section)
        if getattr(scatter, name) == HARDWARE[scenario.hardware][dotted]:
            plant = plant.model_copy(update={section: scatter.model_copy(update={name: 0.0})})
    return plant


def inapplicable(scenario: Scenario, actuator: Actuator) -> list[str]:
    """Return the fields of the hardware set that the machine cannot have."""
    if not isinstance(actuator.torque_data, TorqueField):
        return []
    return [dotted for dotted in SCATTER_OF_A_CURVE if dotted in HARDWARE[scenario.hardware]]


Section = TypeVar("Section", bound=BaseModel)


def _with(kind: type[Section], section: BaseModel, **values: Any) -> Section:
    """Return a section of a resolved class: the fields of a checked section, some with other values.

    A copy of another class: `model_construct` takes ten times as long, which is felt in a study.
    """
    made = section.model_copy(update=values)
    object.__setattr__(made, "__class__", kind)
    return cast("Section", made)


@reused
def _thermal(section: ThermalSection, sheet: Mapping[str, Any]) -> ResolvedThermal:
    return _with(ResolvedThermal, section, **_given_or(section, sheet))


@reused
def _end_stops(section: EndStopsSection) -> EndStopsSection:
    return section.model_copy(update={"on": bool(section.on)})


def _drive(section: DriveSection, actuator: Actuator, hardware: str) -> ResolvedDrive:
    """Return the drive: coils and, without a supply, lag are those of the model file unless given.

    The current limit is the smaller one of the model file and of the amplifiers of the hardware set. Thermal
    data that the model file does not state are those assumed with the set.
    """
    sheet = machine_values(actuator, hardware, "drive")
    limit_A = min(sheet["current_limit_A"], amplifier_limit_A(hardware))
    drive = _with(ResolvedDrive, section, **_given_or(section, {**sheet, "current_limit_A": limit_A}))
    if drive.time_constant_s is not None or drive.supply_V is not None:
        return drive
    constants_s = np.divide(drive.inductance_H, drive.resistance_ohm)
    return drive.model_copy(update={"time_constant_s": per_group(constants_s)})


def _nominal(scenario: Scenario, drive: ResolvedDrive, actuator: Actuator) -> ResolvedNominal:
    """Return the data sheet of the controller; default of a value: the model file, or the true value."""
    section = scenario.nominal
    known = section.equals_truth
    sheet = true_sheet(scenario, drive, actuator) if known else _model_sheet(actuator, scenario.hardware)
    if scenario.sensors.hall.on:  # no set of hardware and no model file states its angles
        sheet = {**sheet, "angle_noise_rad": scenario.sensors.angle_noise_rad}
    return _nominal_of(section, sheet, nominal_curve(scenario))


@reused
def _nominal_of(section: NominalSection, sheet: dict[str, Any], curve: str) -> ResolvedNominal:
    return _with(ResolvedNominal, section, **_given_or(section, {**sheet, "torque_curve": curve}))


def _given_or(section: BaseModel, sheet: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a sheet, replaced by the values that the section gives."""
    given = {name: getattr(section, name) for name in sheet}
    return {
        name: sheet[name] if value is None else per_group(value) if name in PER_GROUP else value
        for name, value in given.items()
    }


@reused
def _model_sheet(actuator: Actuator, hardware: str) -> dict[str, Any]:
    """Return the nominal values of a model file: ideal sensors, amplifiers and bearings, and the coil lag.

    The current limit is the one that holds with the amplifiers of the hardware set.
    """
    ideal = (0.0, 0.0, 0.0)
    return {
        "coulomb_Nm": ideal,
        "viscous_Nm_s": ideal,
        "inertia_kg_m2": tuple(actuator.inertia.tolist()),
        **drive_sheet(_drive(DriveSection(), actuator, hardware)),
        **sensor_sheet(SensorsSection()),
    }


def true_sheet(scenario: Scenario, drive: ResolvedDrive, actuator: Actuator) -> dict[str, Any]:
    """Return the true values as nominal values: the inertia contains modelling error and payload."""
    plant, height_m = scenario.plant, float(actuator.payload_mount_m[2])
    inertia = loaded_inertia((1 + plant.modelling_error) * actuator.inertia, plant.payload_kg, height_m)
    return {
        "coulomb_Nm": plant.coulomb_Nm,
        "viscous_Nm_s": plant.viscous_Nm_s,
        "inertia_kg_m2": tuple(inertia.tolist()),
        **drive_sheet(drive),
        **sensor_sheet(scenario.sensors),
    }


def name_of_user_object(name: str) -> str:
    """Return the name of a user law or trajectory, marked if it could be confused with a shipped one."""
    return f"{name} of the user's" if name in LAWS or name in SHAPES or is_reference(name) else name


def recorded_value(value: Any) -> Any:
    """Return the value of a change in JSON types, as a copy that does not follow changes by the caller."""
    if isinstance(value, Law):
        return name_of_user_object(value.name)
    return json.loads(json.dumps(value, default=as_plain))


def _first_pose(trajectory: Sampled) -> Triple:
    return tuple(trajectory.sample(np.zeros(1))[0, 0].tolist())


_shipped_first_pose = reused(_first_pose)
"""A trajectory of this package does not change: the rows of a study share one."""


def _gravity(section: PlantSection, model: Mjcf) -> float | None:
    """Return the gravity along -z; None if that of the model has another direction and stays active."""
    if section.gravity_m_s2 is not None:
        return section.gravity_m_s2
    return _own_gravity(model)


@reused
def _own_gravity(model: Mjcf) -> float | None:
    own = mjcf.gravity(model.described.opt)
    return None if any(own[:2]) or own[2] > 0 else 0.0 - own[2]  # 0, not -0


@reused
def _ranges(actuator: Actuator) -> list[tuple[float, float]]:
    """Return the ranges of the hinges as numbers of Python, which are compared in less time."""
    return [(low, high) for low, high in actuator.hinge_range_rad.tolist()]


def check_pose(
    pose: Sequence[float] | NDArray[np.float64], actuator: Actuator, what: str = "scenario"
) -> None:
    """Raise InputError for a pose beyond the workspace."""
    for hinge, angle, (low, high) in zip(HINGES, pose, _ranges(actuator), strict=True):
        if not low <= angle <= high:
            least, most, received = distinct_texts(low, high, angle)
            raise InputError(
                f"{what}: expected a pose with {hinge} from {least} to {most} rad, received {received}"
            )


def _check_groups(scenario: Scenario, actuator: Actuator) -> None:
    groups, gain, series = len(actuator.groups), scenario.plant.group_gain, scenario.manual.series
    currents = "manual.file" if scenario.manual.file else "manual.currents_A"
    counts = {"plant.group_gain": groups if gain is None else len(gain)}
    counts[currents] = groups if series is None else series.values.shape[1]
    for section, values in (("drive", scenario.drive), ("nominal", scenario.nominal)):
        given = vars(values)
        counts |= {
            f"{section}.{name}": len(given[name]) for name in PER_GROUP if type(given.get(name)) is tuple
        }
    for name, count in counts.items():
        if count != groups:
            raise InputError(f"scenario: expected {name} for {groups} groups, received {count}")


def _check_faults(faults: tuple[Fault, ...], actuator: Actuator) -> None:
    groups = len(actuator.groups)
    for fault in faults:
        if fault.kind.each_group and fault.place >= groups:
            raise InputError(
                f"scenario: expected a fault of a group from 0 to {groups - 1}, received {fault.target}"
            )


class ActiveConfig(NamedTuple):
    """Configuration that a `Runtime` is built from; a change returns a new one."""

    scenario: ResolvedScenario
    files: Files
    user_law: Law | None
    user_trajectory: UserTrajectory | None

    @property
    def law(self) -> Law:
        """Law of the configuration; a user law that the scenario names is built at each call."""
        return self.user_law or assembly.law_of(self.scenario)

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Telemetry columns of a run."""
        return assembly.signals_of(self.scenario, self.files.actuator, self.law)

    def with_change(self, name: str, value: Any) -> ActiveConfig:
        """Return the configuration with another value of one field, or with another law.

        Raises
        ------
        InputError
            A field that is unknown, of the wrong type or out of range, or a field of a law or trajectory that
            the user replaced.
        """
        if isinstance(value, Law):
            return _config_of(self.scenario, self.files, value, self.user_trajectory)
        if self.user_trajectory and name.split(".")[0] == "trajectory":
            raise InputError(
                "session: expected no field of the scenario's trajectory, because"
                f" {self.user_trajectory.name} replaces it"
            )
        user_law = None if name == "controller.law" else self.user_law
        is_law_field = name.startswith("controller.") and name.split(".")[1] not in COMPENSATORS
        if user_law and is_law_field:
            raise InputError(
                f"session: expected no field of a shipped law, because {user_law.name} is a user law"
            )
        scenario = with_change(self.scenario, name, value)
        files = reload_files(self.files, self.scenario, scenario)
        return _config_of(scenario, files, user_law, self.user_trajectory)

    def check_changes(self, changes: tuple[Change, ...]) -> None:
        """Check changes before a run, each in the configuration that the earlier ones give.

        Raises
        ------
        InputError
            A change is not possible with this law, this trajectory or these files.
        """
        if not changes:
            return
        config, logged = self, with_more({}, self.signals)
        for change in changes:
            try:
                config = config.with_change(change.name, change.value)
                logged = with_more(logged, config.signals)
            except InputError as error:
                at_s = change.tick * self.scenario.controller.period_s
                raise InputError(f"{error}, as the event at {at_s:g} s sets it") from None


def initial_config(
    scenario: Scenario, law: Law | None, trajectory: Sampled | None, files: Files | None = None
) -> ActiveConfig:
    """Return the configuration at the start of a session; default of `files`: read from the scenario.

    Raises
    ------
    InputError
        The scenario or the law is another object, or the model file, the torque curve, the trajectory or a
        value of the scenario cannot be used.
    """
    _check_kinds(scenario, law)
    user_trajectory = None if trajectory is None else checked(trajectory)
    return _config_of(scenario, files or files_of(scenario), law, user_trajectory)


def _config_of(
    scenario: Scenario, files: Files, law: Law | None, trajectory: UserTrajectory | None
) -> ActiveConfig:
    return ActiveConfig(fill_defaults(scenario, files, law, trajectory), files, law, trajectory)


def _check_kinds(scenario: object, law: object) -> None:
    if not isinstance(scenario, Scenario):
        raise InputError(
            f"scenario: expected a scenario, as spheretwin.load returns it, received {shown(scenario)}"
        )
    if not (law is None or isinstance(law, Law)):
        raise InputError(
            f"law: expected a Law, received {shown(law)}; a law of a file is a value of the field"
            ' controller.law, such as "mine.py:Mine"'
        )
