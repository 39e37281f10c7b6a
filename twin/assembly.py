"""Assembly of the loop from a resolved scenario: law, controller, plant, telemetry columns."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.channels import CHANNELS
from spheretwin.control.applied_torque import delay_capacity, fill_applied_torque
from spheretwin.control.compensators.feed_forward import NominalRotor, fill_feed_forward
from spheretwin.control.compensators.prediction import DelayModel, fill_prediction
from spheretwin.control.compensators.reference_governor import fill_governor
from spheretwin.control.controller import Controller, controller
from spheretwin.control.estimators.estimator import Estimator, Sampling
from spheretwin.control.law import Law, NominalModel
from spheretwin.control.laws import LAWS
from spheretwin.electronics.transducers import CurrentSensors
from spheretwin.faults.schedule import part_names
from spheretwin.hardware_assembly import draws_of, drive_of, fill_supervision
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError, SpheretwinError, exception_text, shown
from spheretwin.models.base.record import Rows
from spheretwin.models.base.reuse import reused
from spheretwin.models.magnetics import TorqueModel, scaled, scratch_of, torque_model
from spheretwin.models.scatter import scattered_model
from spheretwin.models.telemetry.signals import Signal, common_signals, width
from spheretwin.plant.bristle_friction import BristleFriction, fill_bristles
from spheretwin.plant.end_stops import fill_end_stops
from spheretwin.plant.friction import Friction, fill_friction
from spheretwin.plant.magnet_heat import MagnetHeat, fill_heat
from spheretwin.plant.mass_properties import mass_errors
from spheretwin.plant.part_scatter import scatter_of
from spheretwin.plant.plant_tick import ENGINES, Plant, engine_step
from spheretwin.plant.rotor import Rotor, RotorSettings
from spheretwin.scenario.files import Files
from spheretwin.scenario.plant_sections import ResolvedNominal, ResolvedPlant
from spheretwin.scenario.sections import ResolvedScenario

Array = NDArray[np.float64]


def law_of(scenario: ResolvedScenario) -> Law:
    """Return the law of a resolved scenario, for its nominal model.

    Raises
    ------
    InputError
        A user law that returns no `Law`, or one for another control period.
    """
    section, nominal = scenario.controller, scenario.nominal
    return (_shipped_law if section.law in LAWS else _built_law)(section, nominal)


def _built_law(section: Any, nominal: ResolvedNominal) -> Law:
    try:
        law = section.build(_known_to(section, nominal))
    except (SpheretwinError, KeyboardInterrupt):
        raise
    except BaseException as error:  # the user's code may raise anything
        raise InputError(
            f"law {section.law}: expected build(known) to make a Law, received {exception_text(error)}"
        ) from error
    if not isinstance(law, Law):
        raise InputError(f"law {section.law}: expected build(known) to make a Law, received {shown(law)}")
    law.check_period(section.period_s)
    return law


_shipped_law = reused(_built_law)
"""A law of this package holds no state: runs copy its memory."""


def same_nominal_model(scenario: ResolvedScenario, other: ResolvedScenario) -> bool:
    """True if the laws of both scenarios receive the same nominal model."""
    first, second = _known(scenario), _known(other)
    same = np.array_equal(first.inertia, second.inertia)
    return same and first._replace(inertia=second.inertia) == second


def _known(scenario: ResolvedScenario) -> NominalModel:
    return _known_to(scenario.controller, scenario.nominal)


@reused
def _known_to(section: Any, nominal: ResolvedNominal) -> NominalModel:
    period_s, delay_s, inertia = section.period_s, nominal.delay_s, np.array(nominal.inertia_kg_m2)
    if section.prediction.on:
        return NominalModel(period_s, 0.0, inertia, ahead_s=delay_s)
    return NominalModel(period_s, delay_s, inertia)


def signals_of(scenario: ResolvedScenario, actuator: Actuator, law: Law) -> tuple[Signal, ...]:
    """Return the telemetry columns of a run: common columns, channels of its stages, signals of the law.

    Raises
    ------
    InputError
        A signal of the law has the name of a signal of a stage.
    """
    groups = len(actuator.groups)
    taken = {signal.name for channel in CHANNELS for signal in channel.signals(groups)}
    if duplicates := sorted(taken & {signal.name for signal in law.signals}):
        raise InputError(f"law {law.name}: expected new names of signals, received {', '.join(duplicates)}")
    signals = common_signals(groups)
    for channel in CHANNELS:
        if channel.logged(scenario):
            signals += channel.signals(groups)
    return signals + law.signals


def nominal_magnetics(scenario: ResolvedScenario, files: Files) -> TorqueModel:
    """Return the magnetics of the data sheet of the controller."""
    return scaled(torque_model(files.nominal), scenario.nominal.torque_scale)


def estimator_of(scenario: ResolvedScenario) -> Estimator | None:
    """Return the rate estimator, tuned to the nominal sensors; None if the rates are exact.

    Raises
    ------
    InputError
        The parameters do not fit the control period or the sensors.
    """
    return _estimator_of(scenario.estimator, scenario.nominal, scenario.controller)


@reused
def _estimator_of(section: Any, nominal: ResolvedNominal, controller: Any) -> Estimator | None:
    noise_rad, quantum_rad = np.array(nominal.angle_noise_rad), np.array(nominal.angle_resolution_rad)
    estimator: Estimator | None = section.build(Sampling(controller.period_s, noise_rad, quantum_rad))
    return estimator


def controller_of(
    scenario: ResolvedScenario,
    law: Law,
    magnetics: TorqueModel,
    estimator: Estimator | None,
    actuator: Actuator,
) -> Controller:
    """Return the controller of a resolved scenario, at the start of a run, for its nominal actuator."""
    nominal, period_s = scenario.nominal, scenario.controller.period_s
    limit_A = min(nominal.current_limit_A, law.current_limit_A)
    delays = delay_capacity(nominal.delay_s, period_s)
    made = controller(law, estimator, magnetics, limit_A, width(law.signals), delays)
    on = law.asks_torque or scenario.detects or scenario.controller.prediction.on
    applied_torque = made.data["applied_torque"]
    fill_applied_torque(applied_torque, on, period_s, nominal.delay_s, nominal.time_constant_s)
    _fill_compensators(made.data["compensators"], scenario)
    fill_supervision(made.data["supervision"], scenario, actuator)
    made.data["manual"]["on"] = scenario.manual.on
    return made


def _fill_compensators(rows: Rows, scenario: ResolvedScenario) -> None:
    section, nominal, known = scenario.controller, scenario.nominal, _known(scenario)
    delay = DelayModel(known.period_s, known.ahead_s, nominal.time_constant_s, known.inertia)
    rotor = NominalRotor(known.inertia, np.array(nominal.coulomb_Nm), np.array(nominal.viscous_Nm_s))
    rows["on"] = section.governor.on or section.prediction.on or section.feed_forward.on
    fill_governor(rows["governor"], section.governor, known.period_s)
    fill_prediction(rows["prediction"], section.prediction, delay)
    fill_feed_forward(rows["feed_forward"], section.feed_forward, rotor, known.period_s, known.delay_s)


def true_magnetics(section: ResolvedPlant, seed: int, actuator: Actuator) -> TorqueModel:
    """Return the magnetics of the true plant, with the scatter of its poles and coils."""
    scatter = scatter_of(section, seed, actuator)
    return scattered_model(actuator, scatter) if scatter else torque_model(actuator)


def plant_of(scenario: ResolvedScenario, files: Files, rotor: Rows, halt: NDArray[np.int64]) -> Plant:
    """Return the plant of a resolved scenario with a started rotor, the `halt` of its watchdog, at rest."""
    section, actuator, groups = scenario.plant, files.actuator, len(files.actuator.groups)
    middle_q, middle_qdot, coil_q, coil_qdot = np.empty((4, 3))
    magnetics = true_magnetics(section, scenario.seed, actuator)
    drive, group_gain = drive_of(scenario, actuator), np.array(section.group_gain)
    current_sensors = CurrentSensors.zeros(groups=groups)
    current_sensors["on"] = scenario.senses_currents
    current_sensors["noise_A"] = scenario.sensors.current.noise_A
    step = engine_step(section.engine)
    return Plant(
        step=getattr(step, "address", step),
        rotor=rotor,
        magnetics=magnetics,
        G=np.empty((3, groups)),
        scratch=scratch_of(magnetics),
        drive=drive,
        friction=Friction.filled(_fill_friction, section),
        bristles=BristleFriction.filled(
            _fill_bristles, section, actuator.hinge_range_rad, rotor["joint"]["inertia"], scenario.seed
        ),
        heat=MagnetHeat.filled(_fill_heat, scenario, drive, groups=groups),
        group_gain=group_gain,
        present_gain=np.empty(groups),
        unmodelled_torque=np.array(section.modelling_torque_Nm),
        hinge_range=actuator.hinge_range_rad,
        substeps=scenario.substeps,
        step_s=section.step_s,
        middle_q=middle_q,
        middle_qdot=middle_qdot,
        coil_q=coil_q,
        coil_qdot=coil_qdot,
        last_qdot=rotor["qdot"][0].copy(),
        current=np.zeros(groups),
        mean_current=np.zeros(groups),
        effective_current=np.zeros(groups),
        torque_S=np.zeros(3),
        friction_q=np.zeros(3),
        first_friction_q=np.zeros(3),
        draws=draws_of(scenario, groups),
        halt=halt,
        current_sensors=current_sensors,
        fault_modes=np.zeros(len(part_names(groups))),
        fault_start_s=np.full(groups, -1.0),
    )


def _fill_friction(rows: Rows, section: ResolvedPlant) -> None:
    coulomb_Nm = np.zeros(3) if section.stiction.on else np.array(section.coulomb_Nm)
    smoothing_rad_s, step_s = section.friction_smoothing_rad_s, section.step_s
    fill_friction(rows, coulomb_Nm, np.array(section.viscous_Nm_s), smoothing_rad_s, step_s)


def _fill_bristles(rows: Rows, section: ResolvedPlant, range_rad: Array, inertia: Array, seed: int) -> None:
    stiction, step_s = section.stiction, section.step_s
    fill_end_stops(rows["stops"], section.end_stops, range_rad, inertia, step_s)
    fill_bristles(rows, stiction, section.coulomb_Nm, section.cable, inertia, step_s, seed)


def _fill_heat(rows: Rows, scenario: ResolvedScenario, drive: Rows) -> None:
    section, period_s = scenario.drive, scenario.controller.period_s
    winding = section.heat_capacity_J_K, drive["coil"]["settled"][0]
    fill_heat(rows, scenario.plant.thermal, section.ambient_degC, period_s, *winding)


def rotor_of(scenario: ResolvedScenario, files: Files) -> Rotor:
    """Return the rotor of a resolved scenario, in its engine.

    Raises
    ------
    InputError
        The engine does not support the model.
    """
    return ENGINES[scenario.plant.engine].set_up(_rotor_settings(scenario, files))


def _rotor_settings(scenario: ResolvedScenario, files: Files) -> RotorSettings:
    section = scenario.plant
    return RotorSettings(
        model=files.model,
        actuator=files.actuator,
        step_s=section.step_s,
        integrator=section.integrator,
        modelling_error=section.modelling_error,
        payload_kg=section.payload_kg,
        gravity_m_s2=section.gravity_m_s2,
        mass=mass_errors(section.mass, scenario.seed),
    )
