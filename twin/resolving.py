"""What a scenario leaves open, filled in from its files; what it overrides in them; its lists, checked."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from spheretwin.control.law import Law
from spheretwin.control.laws.registry import LAWS
from spheretwin.models import mjcf
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.user_code import is_reference
from spheretwin.models.base.wording import told_apart
from spheretwin.models.magnetics import disagreements
from spheretwin.models.mjcf import Mjcf
from spheretwin.models.model_file.joint import HINGES
from spheretwin.twin.electronics.driving.sections import DriveSection
from spheretwin.twin.faults.fault import Fault
from spheretwin.twin.plant.engine import integrator_name
from spheretwin.twin.scenario.files import Files
from spheretwin.twin.scenario.planned import planned
from spheretwin.twin.scenario.sections import OwnController, OwnPath, Scenario
from spheretwin.twin.scenario.sections import Plant as PlantSection
from spheretwin.twin.trajectories.registry import SHAPES
from spheretwin.twin.trajectories.trajectory import OwnTrajectory, Sampled, Triple

# What the engine's compiler takes where a file says nothing.
UNWRITTEN_STEP_s = 0.002
UNWRITTEN_INTEGRATOR = "Euler"
UNWRITTEN_GRAVITY_m_s2 = (0.0, 0.0, -9.81)


def resolved(scenario: Scenario, files: Files, law: Law | None, trajectory: OwnTrajectory | None) -> Scenario:
    """Scenario whose open values are filled in from the model and the trajectory.

    Raises
    ------
    InputError
        The first pose is outside the hinges' range, a list does not fit the actuator, or the law is made for
        another control period.
    """
    actuator, given, nominal, section = files.actuator, scenario.drive, scenario.nominal, scenario.plant
    group = actuator.group
    lag_s, limit_A = given.time_constant_s, given.current_limit_A
    resistance_ohm = group.resistance_ohm if given.resistance_ohm is None else given.resistance_ohm
    inductance_H = group.inductance_H if given.inductance_H is None else given.inductance_H
    if lag_s is None and given.supply_V is None:
        lag_s = inductance_H / resistance_ohm
    drive_section = given.model_copy(
        update={
            "time_constant_s": lag_s,
            "current_limit_A": group.current_limit_A if limit_A is None else limit_A,
            "resistance_ohm": resistance_ohm,
            "inductance_H": inductance_H,
        }
    )
    filled: dict[str, Any] = {
        "drive": drive_section,
        "nominal": nominal.model_copy(
            update={
                "inertia_kg_m2": nominal.inertia_kg_m2 or tuple(actuator.inertia.tolist()),
                "current_limit_A": nominal.current_limit_A or drive_section.current_limit_A,
                "time_constant_s": (
                    lag_of(drive_section) if nominal.time_constant_s is None else nominal.time_constant_s
                ),
                "delay_s": given.delay_s if nominal.delay_s is None else nominal.delay_s,
                "coulomb_Nm": nominal.coulomb_Nm or section.coulomb_Nm,
                "viscous_Nm_s": nominal.viscous_Nm_s or section.viscous_Nm_s,
            }
        ),
        "plant": section.model_copy(
            update={
                "initial_rad": section.initial_rad or _first_pose(trajectory or scenario.trajectory),
                "gravity_m_s2": _gravity(section, files.model),
            }
        ),
    }
    if law:
        law.check_period(scenario.controller.period_s)
        filled["controller"] = OwnController(
            law=name_of_own(law.name),
            period_s=scenario.controller.period_s,
            parameters=tuple(law.parameters.tolist()),
            **scenario.controller.around,
        )
    if trajectory:
        filled["trajectory"] = OwnPath(shape=name_of_own(trajectory.name))
    made = scenario.model_copy(update=filled)
    _check_pose(made.plant.initial_rad or (0.0, 0.0, 0.0), actuator)
    _check_groups(made, actuator)
    _check_faults(made.fault, actuator)
    return made


def warnings_of(scenario: Scenario, files: Files) -> list[str]:
    """What a user should know of model and scenario before believing the figures; one line each."""
    late = [change for change in planned(scenario) if change.tick >= scenario.ticks]
    return [
        *files.model.warnings,
        *disagreements(files.actuator),
        *_overridden(scenario.plant, files.model.described.opt),
        *(f"the event that sets {change.name} is not made: the run ends before" for change in late),
    ]


def _overridden(section: PlantSection, option: mujoco.MjOption) -> list[str]:
    """What a model file says and a scenario says otherwise; what a file does not say is not overridden."""
    found = []
    if option.timestep not in (section.step_s, UNWRITTEN_STEP_s):
        own, used = told_apart(option.timestep, section.step_s)
        found.append(f"the model's own timestep of {own} s is not used: plant.step_s is {used} s")
    integrator = integrator_name(option.integrator)
    if integrator not in (section.integrator, UNWRITTEN_INTEGRATOR):
        found.append(
            f"the model's own integrator {integrator} is not used: plant.integrator is {section.integrator}"
        )
    given, gravity = section.gravity_m_s2, mjcf.gravity(option)
    if given is not None and gravity not in ((0.0, 0.0, -given), UNWRITTEN_GRAVITY_m_s2):
        own = " ".join(f"{component:.10g}" for component in gravity)
        found.append(
            f"the model's own gravity of {own} m/s² is not used: plant.gravity_m_s2 is {given:.10g} m/s²"
        )
    return found


def name_of_own(name: str) -> str:
    """Name of a law or trajectory of the user's, where it must not be taken for one that can be had."""
    return f"{name} of the user's" if name in LAWS or name in SHAPES or is_reference(name) else name


def lag_of(drive: DriveSection) -> float:
    """Lag of the currents while no voltage is at its limit."""
    return 1 / drive.bandwidth_rad_s if drive.supply_V is not None else drive.time_constant_s or 0.0


def _first_pose(trajectory: Sampled) -> Triple:
    return tuple(trajectory.sample(np.zeros(1))[0, 0].tolist())


def _gravity(section: PlantSection, model: Mjcf) -> float | None:
    """Gravity along -z; None where the model's is not along it, so that the model's stays in force."""
    if section.gravity_m_s2 is not None:
        return section.gravity_m_s2
    own = mjcf.gravity(model.described.opt)
    return None if any(own[:2]) or own[2] > 0 else 0.0 - own[2]  # none is 0, not -0


def _check_pose(pose: Triple, actuator: Actuator) -> None:
    for hinge, angle, (low, high) in zip(HINGES, pose, actuator.hinge_range_rad, strict=True):
        if not low <= angle <= high:
            least, most, received = told_apart(low, high, angle)
            raise InputError(
                f"scenario: expected a first pose with {hinge} from {least} to {most} rad,"
                f" received {received}"
            )


def _check_groups(scenario: Scenario, actuator: Actuator) -> None:
    groups = len(actuator.groups)
    lists = {"plant.group_gain": scenario.plant.group_gain, "manual.currents_A": scenario.manual.currents_A}
    for name, given in lists.items():
        if given is not None and len(given) != groups:
            raise InputError(f"scenario: expected {name} for {groups} groups, received {len(given)}")


def _check_faults(faults: tuple[Fault, ...], actuator: Actuator) -> None:
    groups = len(actuator.groups)
    for fault in faults:
        if fault.kind.each_group and fault.place >= groups:
            raise InputError(
                f"scenario: expected a fault of a group from 0 to {groups - 1}, received {fault.target}"
            )
