"""From a scenario to the parts of its loop: open values filled in, controller and plant built."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from spheretwin.control.belief import belief
from spheretwin.control.controller import Controller, Supervision, controller
from spheretwin.control.estimation.estimator import Estimator, Sampling
from spheretwin.control.law import Known, Law
from spheretwin.control.laws.registry import LAWS
from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf, torque_curve
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.base.user_code import is_reference
from spheretwin.models.base.wording import shown, told_apart, without_breaks
from spheretwin.models.lagrangian import loaded_inertia
from spheretwin.models.magnetics import KeptMatrix, TorqueModel, disagreements, kept_matrix, torque_model
from spheretwin.models.mjcf import Mjcf
from spheretwin.models.model_file.joint import HINGES
from spheretwin.models.telemetry.signals import (
    Signal,
    common_signals,
    offsets,
    width,
)
from spheretwin.twin.columns.registry import ALL
from spheretwin.twin.electronics.driving.sections import DriveSection
from spheretwin.twin.electronics.sensing.chain import reckoned
from spheretwin.twin.faults.fault import Fault
from spheretwin.twin.faults.plan import part_names
from spheretwin.twin.loop import Places
from spheretwin.twin.plant.engine import integrator_name
from spheretwin.twin.plant.friction import Friction, friction
from spheretwin.twin.plant.plant import Plant
from spheretwin.twin.plant.registry import ENGINES
from spheretwin.twin.plant.rotor import Rotor, Setting
from spheretwin.twin.scenario.planned import planned
from spheretwin.twin.scenario.sections import OwnController, OwnPath, Scenario
from spheretwin.twin.scenario.sections import Plant as PlantSection
from spheretwin.twin.trajectories.registry import SHAPES
from spheretwin.twin.trajectories.trajectory import OwnTrajectory, Sampled, Triple
from spheretwin.twin.wiring.wires import Wires, driving_of

Array = NDArray[np.float64]

# What the engine's compiler takes where a file says nothing.
UNWRITTEN_STEP_s = 0.002
UNWRITTEN_INTEGRATOR = "Euler"
UNWRITTEN_GRAVITY_m_s2 = (0.0, 0.0, -9.81)


class Files(NamedTuple):
    """What the files of a scenario say, read once for a session: an edit meanwhile changes nothing of it."""

    model: Mjcf
    actuator: Actuator
    nominal: Actuator
    """As the controller has it: the very same unless it has another torque curve."""


def files_of(scenario: Scenario) -> Files:
    """Read model file and torque curves of a scenario."""
    path = Path(scenario.plant.mjcf or actuators.MJCF_PATH)
    curve = Path(scenario.plant.torque_curve or actuators.TORQUE_CURVE_PATH)
    actuator = actuators.load(path, curve)
    other = scenario.nominal.torque_curve
    return Files(mjcf.read(path), actuator, actuators.load(path, Path(other)) if other else actuator)


def files_again(files: Files, before: Scenario, scenario: Scenario) -> Files:
    """Files of a changed scenario: what it names as before stays as it was read."""
    if scenario.plant.mjcf != before.plant.mjcf:
        return files_of(scenario)
    actuator, nominal, other = files.actuator, files.nominal, scenario.nominal.torque_curve
    if scenario.plant.torque_curve != before.plant.torque_curve:
        actuator = _with_curve(files.model, scenario.plant.torque_curve)
    if other is None:
        nominal = actuator
    elif other != before.nominal.torque_curve:
        nominal = _with_curve(files.model, other)
    return Files(files.model, actuator, nominal)


def _with_curve(model: Mjcf, curve: str | None) -> Actuator:
    read = torque_curve.read(Path(curve or actuators.TORQUE_CURVE_PATH))
    return actuators.from_model(model.described, read)


def _lag_s(drive: DriveSection) -> float:
    """Lag of the currents while no voltage is at its limit."""
    return 1 / drive.bandwidth_rad_s if drive.supply_V is not None else drive.time_constant_s or 0.0


def name_of_own(name: str) -> str:
    """Name of a law or trajectory of the user's, where it must not be taken for one that can be had."""
    return f"{name} of the user's" if name in LAWS or name in SHAPES or is_reference(name) else name


def named_files(scenario: Scenario) -> tuple[str | None, ...]:
    """Names by which a scenario finds its files."""
    return scenario.plant.mjcf, scenario.plant.torque_curve, scenario.nominal.torque_curve


def digest(files: Files) -> str:
    """Digest of all that files say of the physics, by which a snapshot knows its model."""
    models = (files.model.described, files.model.loaded)
    content = [np.empty(mujoco.mj_sizeModel(model), np.uint8) for model in models]
    for model, buffer in zip(models, content, strict=True):
        mujoco.mj_saveModel(model, None, buffer)
    for actuator in (files.actuator, files.nominal):
        content += [actuator.torque_curve.phi_rad, actuator.torque_curve.torque_Nm_per_A]
    return hashlib.sha256(b"".join(each.tobytes() for each in content)).hexdigest()


def resolved(scenario: Scenario, files: Files, law: Law | None, trajectory: OwnTrajectory | None) -> Scenario:
    """Scenario whose open values are filled in from the model and the trajectory.

    Raises
    ------
    InputError
        The first pose is outside the hinges' range, or a list does not fit the actuator.
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
                    _lag_s(drive_section) if nominal.time_constant_s is None else nominal.time_constant_s
                ),
                "delay_s": given.delay_s if nominal.delay_s is None else nominal.delay_s,
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
        filled["controller"] = OwnController(
            law=name_of_own(law.name),
            period_s=scenario.controller.period_s,
            parameters=tuple(law.parameters.tolist()),
        )
    if trajectory:
        filled["trajectory"] = OwnPath(shape=name_of_own(trajectory.name))
    made = scenario.model_copy(update=filled)
    _check_pose(made.plant.initial_rad or (0.0, 0.0, 0.0), actuator)
    _check_groups(section, actuator)
    _check_faults(made.fault, actuator)
    return made


def law_of(scenario: Scenario) -> Law:
    """Law that a resolved scenario names, for its nominal model.

    Raises
    ------
    InputError
        It is one of the user's, and makes none.
    """
    section = scenario.controller
    try:
        law = section.build(_known(scenario))
    except SpheretwinError:
        raise
    except Exception as error:  # whatever a user's code may raise
        told = without_breaks(error) or "no word of why"
        raise InputError(
            f"law {section.law}: expected build(known) to make a Law, received {type(error).__name__}: {told}"
        ) from error
    if not isinstance(law, Law):
        raise InputError(f"law {section.law}: expected build(known) to make a Law, received {shown(law)}")
    return law


def same_known(scenario: Scenario, other: Scenario) -> bool:
    """Whether a law is told the same of both."""
    first, second = _known(scenario), _known(other)
    return first[:2] == second[:2] and np.array_equal(first.inertia, second.inertia)


def _known(scenario: Scenario) -> Known:
    nominal = scenario.nominal
    return Known(scenario.controller.period_s, nominal.delay_s or 0.0, np.array(nominal.inertia_kg_m2))


def signals_of(scenario: Scenario, actuator: Actuator, law: Law) -> tuple[Signal, ...]:
    """Columns of a run's telemetry: common ones, those of its stages, then the law's own.

    Raises
    ------
    InputError
        The law has a signal under the name of a stage's.
    """
    groups = len(actuator.groups)
    taken = {signal.name for columns in ALL for signal in columns.signals(groups)}
    if twice := sorted(taken & {signal.name for signal in law.signals}):
        raise InputError(f"law {law.name}: expected new names of signals, received {', '.join(twice)}")
    found = common_signals(groups)
    for columns in ALL:
        if columns.logged(scenario):
            found += columns.signals(groups)
    return found + law.signals


def places_of(signals: tuple[Signal, ...], law: Law) -> Places:
    """Where the loop finds the columns that not every run has."""
    first = offsets(signals)
    of_stages = tuple(first.get(columns.signals(1)[0].name, -1) for columns in ALL)
    return Places(of_stages, width(signals) - width(law.signals))


def warnings_of(scenario: Scenario, files: Files) -> list[str]:
    """What a user should know of model and scenario before believing the figures; one line each."""
    late = [change for change in planned(scenario) if change.tick >= scenario.ticks]
    return [
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


def nominal_magnetics(scenario: Scenario, files: Files) -> TorqueModel:
    """Magnetics as the controller has them; the plant's very own where nothing says otherwise."""
    model, scale = torque_model(files.nominal), scenario.nominal.torque_scale
    return model if scale == 1 else model._replace(line_weights=scale * model.line_weights)


def estimator_of(scenario: Scenario) -> Estimator | None:
    """Estimator of the rates, tuned to what the controller reckons with; None where the rates are true.

    Raises
    ------
    InputError
        Its parameters do not fit the control period or the sensors.
    """
    noise_rad, quantum_rad = reckoned(scenario.sensors)
    return scenario.estimator.build(Sampling(scenario.controller.period_s, noise_rad, quantum_rad))


def controller_of(
    scenario: Scenario,
    law: Law,
    magnetics: TorqueModel,
    kept: KeptMatrix,
    estimator: Estimator | None,
    supervision: Supervision,
) -> Controller:
    """Controller of a resolved scenario, at the start of a run."""
    nominal, groups = scenario.nominal, magnetics.group_axes.shape[1]
    limit_A, lag_s = nominal.current_limit_A or 0.0, nominal.time_constant_s or 0.0
    asked = law.asks_torque or scenario.detects
    believed = belief(asked, groups, scenario.controller.period_s, nominal.delay_s or 0.0, lag_s)
    return controller(law, magnetics, kept, limit_A, width(law.signals), believed, supervision, estimator)


def plant_of(scenario: Scenario, actuator: Actuator, stepped: Any, kept: KeptMatrix, wires: Wires) -> Plant:
    """Plant of a resolved scenario around a rotor that has been started, without currents as yet."""
    section, groups = scenario.plant, len(actuator.groups)
    return Plant(
        rotor=stepped,
        magnetics=torque_model(actuator),
        kept=kept,
        driving=driving_of(scenario, groups, wires),
        friction=_friction(section, actuator),
        group_gain=group_gain_of(section, groups),
        unmodelled_torque=np.array(section.modelling_torque_Nm),
        hinge_range=actuator.hinge_range_rad,
        substeps=scenario.substeps,
        current=np.zeros(groups),
        mean_current=np.zeros(groups),
        pulling=np.zeros(groups),
        friction_q=np.zeros(3),
        first_friction_q=np.zeros(3),
        draws=wires.draws,
        current_noise_A=scenario.sensors.current.noise_A,
        marks=np.zeros(len(part_names(groups))),
        began_s=np.full(groups, -1.0),
    )


def group_gain_of(section: PlantSection, groups: int) -> Array:
    """Torque an ampere of each group over that of the torque curve, (n,), while none fails."""
    return np.array(section.group_gain or (1.0,) * groups)


def _friction(section: PlantSection, actuator: Actuator) -> Friction:
    height = float(actuator.payload_mount_m[2])
    return friction(
        np.array(section.coulomb_Nm),
        np.array(section.viscous_Nm_s),
        section.friction_smoothing_rad_s,
        loaded_inertia((1 + section.modelling_error) * actuator.inertia, section.payload_kg, height),
        section.step_s,
    )


def kept_matrices(nominal: TorqueModel, true: TorqueModel) -> tuple[KeptMatrix, KeptMatrix]:
    """Kept torque matrices of controller and plant: one and the same only where both have one model."""
    kept = kept_matrix(nominal)
    return kept, kept if nominal is true else kept_matrix(true)


def rotor_of(scenario: Scenario, files: Files) -> Rotor:
    """Rotor of a resolved scenario, in the engine that it names.

    Raises
    ------
    InputError
        The engine does not know all that the model holds.
    """
    section = scenario.plant
    return ENGINES[section.engine].set_up(
        Setting(
            model=files.model,
            actuator=files.actuator,
            step_s=section.step_s,
            integrator=section.integrator,
            modelling_error=section.modelling_error,
            payload_kg=section.payload_kg,
            gravity_m_s2=section.gravity_m_s2,
        )
    )


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


def _check_groups(section: PlantSection, actuator: Actuator) -> None:
    groups = len(actuator.groups)
    if section.group_gain is not None and len(section.group_gain) != groups:
        raise InputError(
            f"scenario: expected plant.group_gain for {groups} groups, received {len(section.group_gain)}"
        )


def _check_faults(faults: tuple[Fault, ...], actuator: Actuator) -> None:
    groups = len(actuator.groups)
    for fault in faults:
        if fault.kind.each_group and fault.place >= groups:
            raise InputError(
                f"scenario: expected a fault of a group from 0 to {groups - 1}, received {fault.target}"
            )
