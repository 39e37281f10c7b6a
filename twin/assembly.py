"""From a resolved scenario to the parts of its loop: law, controller, plant, and the columns they log."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.channels import CHANNELS
from spheretwin.control.applied_torque import applied_torque
from spheretwin.control.compensators import Compensators
from spheretwin.control.compensators.feed_forward import NominalRotor, feed_forward
from spheretwin.control.compensators.prediction import DelayModel, prediction
from spheretwin.control.compensators.reference_governor import governor
from spheretwin.control.controller import Controller, Supervision, controller
from spheretwin.control.estimators.estimator import Estimator, Sampling
from spheretwin.control.law import Law, NominalModel
from spheretwin.control.manual_currents import manual
from spheretwin.electronics.transducers import CurrentSensors
from spheretwin.faults.schedule import part_names
from spheretwin.loop import Places
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError, SpheretwinError, exception_text, shown
from spheretwin.models.lagrangian import loaded_inertia
from spheretwin.models.magnetics import TorqueModel, scratch_of, torque_model
from spheretwin.models.telemetry.signals import Signal, common_signals, offsets, width
from spheretwin.plant.friction import Friction, friction
from spheretwin.plant.rotor import Rotor, Setting
from spheretwin.plant.step import ENGINES, Plant
from spheretwin.scenario.files import Files
from spheretwin.scenario.sections import ResolvedPlant, ResolvedScenario
from spheretwin.shared_buffers import Wires, driving_of

Array = NDArray[np.float64]


def law_of(scenario: ResolvedScenario) -> Law:
    """Law that a resolved scenario names, for its nominal model.

    Raises
    ------
    InputError
        It is one of the user's, and makes none, or one for another control period.
    """
    section = scenario.controller
    try:
        law = section.build(_known(scenario))
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


def same_known(scenario: ResolvedScenario, other: ResolvedScenario) -> bool:
    """Whether a law is told the same of both."""
    first, second = _known(scenario), _known(other)
    same = np.array_equal(first.inertia, second.inertia)
    return same and first._replace(inertia=second.inertia) == second


def _known(scenario: ResolvedScenario) -> NominalModel:
    nominal, period_s = scenario.nominal, scenario.controller.period_s
    delay_s, inertia = nominal.delay_s, np.array(nominal.inertia_kg_m2)
    if scenario.controller.prediction.on:
        return NominalModel(period_s, 0.0, inertia, ahead_s=delay_s)
    return NominalModel(period_s, delay_s, inertia)


def signals_of(scenario: ResolvedScenario, actuator: Actuator, law: Law) -> tuple[Signal, ...]:
    """Columns of a run's telemetry: common ones, those of its stages, then the law's own.

    Raises
    ------
    InputError
        The law has a signal under the name of a stage's.
    """
    groups = len(actuator.groups)
    taken = {signal.name for columns in CHANNELS for signal in columns.signals(groups)}
    if twice := sorted(taken & {signal.name for signal in law.signals}):
        raise InputError(f"law {law.name}: expected new names of signals, received {', '.join(twice)}")
    found = common_signals(groups)
    for columns in CHANNELS:
        if columns.logged(scenario):
            found += columns.signals(groups)
    return found + law.signals


def places_of(signals: tuple[Signal, ...], law: Law) -> Places:
    """Where the loop finds the columns that not every run has."""
    first = offsets(signals)
    of_stages = tuple(first.get(columns.signals(1)[0].name, -1) for columns in CHANNELS)
    return Places(of_stages, width(signals) - width(law.signals))


def nominal_magnetics(scenario: ResolvedScenario, files: Files) -> TorqueModel:
    """Magnetics of the controller's data sheet."""
    model, scale = torque_model(files.nominal), scenario.nominal.torque_scale
    return model if scale == 1 else model._replace(line_weights=scale * model.line_weights)


def estimator_of(scenario: ResolvedScenario) -> Estimator | None:
    """Estimator of the rates, tuned to the nominal sensors; None where the rates are true.

    Raises
    ------
    InputError
        Its parameters do not fit the control period or the sensors.
    """
    nominal = scenario.nominal
    noise_rad, quantum_rad = np.array(nominal.angle_noise_rad), np.array(nominal.angle_resolution_rad)
    return scenario.estimator.build(Sampling(scenario.controller.period_s, noise_rad, quantum_rad))


def controller_of(
    scenario: ResolvedScenario,
    law: Law,
    magnetics: TorqueModel,
    estimator: Estimator | None,
    supervision: Supervision,
) -> Controller:
    """Controller of a resolved scenario, at the start of a run."""
    nominal, groups = scenario.nominal, magnetics.group_axes.shape[1]
    on = law.asks_torque or scenario.detects or scenario.controller.prediction.on
    applied = applied_torque(
        on, groups, scenario.controller.period_s, nominal.delay_s, nominal.time_constant_s
    )
    compensators = _compensators_of(scenario, magnetics)
    by_hand = manual(scenario.manual, groups)
    return controller(
        law,
        magnetics,
        nominal.current_limit_A,
        width(law.signals),
        applied,
        compensators,
        supervision,
        by_hand,
        estimator,
    )


def _compensators_of(scenario: ResolvedScenario, magnetics: TorqueModel) -> Compensators:
    """What stands around the law of a resolved scenario."""
    section, nominal, known = scenario.controller, scenario.nominal, _known(scenario)
    delay = DelayModel(known.period_s, known.ahead_s, nominal.time_constant_s, known.inertia)
    rotor = NominalRotor(known.inertia, np.array(nominal.coulomb_Nm), np.array(nominal.viscous_Nm_s))
    return Compensators(
        section.governor.on or section.prediction.on or section.feed_forward.on,
        governor(section.governor, known.period_s),
        prediction(section.prediction, delay, magnetics),
        feed_forward(section.feed_forward, rotor, known.period_s, known.delay_s),
    )


def plant_of(scenario: ResolvedScenario, actuator: Actuator, stepped: Any, wires: Wires) -> Plant:
    """Plant of a resolved scenario around a rotor that has been started, without currents as yet."""
    section, groups, magnetics = scenario.plant, len(actuator.groups), torque_model(actuator)
    return Plant(
        rotor=stepped,
        magnetics=magnetics,
        G=np.empty((3, groups)),
        scratch=scratch_of(magnetics),
        driving=driving_of(scenario, groups, wires),
        friction=_friction(section, actuator),
        group_gain=np.array(section.group_gain),
        unmodelled_torque=np.array(section.modelling_torque_Nm),
        hinge_range=actuator.hinge_range_rad,
        substeps=scenario.substeps,
        step_s=section.step_s,
        middle_q=np.empty(3),
        middle_qdot=np.empty(3),
        last_qdot=stepped.qdot.copy(),
        current=np.zeros(groups),
        mean_current=np.zeros(groups),
        pulling=np.zeros(groups),
        torque_S=np.zeros(3),
        friction_q=np.zeros(3),
        first_friction_q=np.zeros(3),
        draws=wires.draws,
        current_sensors=CurrentSensors(
            scenario.senses_currents, scenario.sensors.current.noise_A, np.zeros(groups)
        ),
        marks=np.zeros(len(part_names(groups))),
        began_s=np.full(groups, -1.0),
    )


def _friction(section: ResolvedPlant, actuator: Actuator) -> Friction:
    height = float(actuator.payload_mount_m[2])
    return friction(
        np.array(section.coulomb_Nm),
        np.array(section.viscous_Nm_s),
        section.friction_smoothing_rad_s,
        loaded_inertia((1 + section.modelling_error) * actuator.inertia, section.payload_kg, height),
        section.step_s,
    )


def rotor_of(scenario: ResolvedScenario, files: Files) -> Rotor:
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
