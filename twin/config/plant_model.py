"""Parameters of the public plant step from a scenario."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.config.active_config import initial_config
from spheretwin.loop import assembly
from spheretwin.models.base.errors import InputError
from spheretwin.plant.cable import constant_torque_Nm
from spheretwin.plant.lagrangian_rotor import LagrangianRotor
from spheretwin.plant.magnet_heat import remanence
from spheretwin.plant.plant_step import Parameters
from spheretwin.scenario.files import Files
from spheretwin.scenario.sections import ResolvedScenario, Scenario


def parameters(scenario: Scenario | str, changes: Mapping[str, Any] | None = None) -> Parameters:
    """Return the parameters of the plant step of a scenario.

    Parameters
    ----------
    scenario : Scenario or str
        From `scenario.load`, or the name or file of one.
    changes : mapping, optional
        Fields by dotted name and their values, such as ``{"plant.payload_kg": 0.1}``, for a name or a file.

    Returns
    -------
    plant.Parameters
        Of the true plant, with the errors that the seed draws, and magnets at their initial temperature.

    Raises
    ------
    InputError
        A field is unknown or out of range, changes of a built scenario, static friction, backlash, hysteresis
        of a cable, end stops, or a model with physics that the equations of motion do not have.
    """
    if isinstance(scenario, str):
        scenario = scenarios.load(scenario, changes)
    elif changes:
        raise InputError("plant parameters: expected changes with the name or file of a scenario alone")
    config = initial_config(scenario, None, None)
    section = config.scenario.plant
    if section.stiction.on or any(section.cable.hysteresis_Nm + section.backlash_rad) or section.end_stops.on:
        raise InputError(
            "plant parameters: expected smoothed friction, no backlash, no hysteresis of a cable and no end"
            " stops, which the step does not have, received plant.stiction, plant.backlash_rad,"
            " plant.cable.hysteresis_Nm or plant.end_stops"
        )
    return parameters_of(config.scenario, config.files)


def parameters_of(scenario: ResolvedScenario, files: Files) -> Parameters:
    """Return the parameters of a resolved scenario, without what `parameters` refuses for its states.

    Raises
    ------
    InputError
        The model has physics that the equations of motion do not have, or a learned torque.
    """
    section, cable = scenario.plant, scenario.plant.cable
    if section.learned_torque.file:
        raise InputError(
            "plant parameters: expected no learned torque, which the step does not have, received"
            " plant.learned_torque"
        )
    engine = section.model_copy(update={"engine": "lagrangian", "integrator": "RK4"})
    rotor = cast("LagrangianRotor", assembly.rotor_of(scenario.model_copy(update={"plant": engine}), files))
    joint = rotor.joint
    spring = np.array(cable.stiffness_Nm_rad)
    cable_Nm = constant_torque_Nm(cable, scenario.seed) + spring * cable.neutral_rad
    return Parameters(
        inertia_kg_m2=joint["inertia"][0].copy(),
        weight_moment_Nm=float(joint["weight_moment"][0]),
        joint=joint,
        coulomb_Nm=np.array(section.coulomb_Nm),
        coulomb_asymmetry=np.array(section.coulomb_asymmetry),
        viscous_Nm_s=np.array(section.viscous_Nm_s),
        friction_smoothing_rad_s=section.friction_smoothing_rad_s,
        constant_torque_Nm=np.array(section.modelling_torque_Nm) - cable_Nm,
        spring_Nm_rad=spring,
        torque_gain=remanence(section.thermal, scenario.drive.ambient_degC) * np.array(section.group_gain),
        magnetics=assembly.true_magnetics(section, scenario.seed, files.actuator),
    )
