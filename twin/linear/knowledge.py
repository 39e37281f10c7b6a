"""What a linear model is made of: the numbers of the true plant, or of the nominal one."""

from __future__ import annotations

from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.twin import assembly
from spheretwin.twin.plant.lagrangian import LagrangianRotor
from spheretwin.twin.scenario.files import Files
from spheretwin.twin.scenario.sections import ResolvedScenario

Array = NDArray[np.float64]


class Magnetics(NamedTuple):
    """A torque matrix: that of an actuator, each column times a gain."""

    actuator: Actuator
    gain: Array  # (n,)


class Knowledge(NamedTuple):
    """The numbers of a resolved scenario that a linear model depends on."""

    inertia: Array
    """Principal inertias about the joint centre, (3,) in kg·m²; payload included."""
    weight_moment: float
    """m g l of the payload, N·m."""
    viscous_Nm_s: Array
    """Of each hinge, (3,)."""
    unknown_torque_Nm: Array
    """Constant, (3,): it pulls against the coils."""
    magnetics: Magnetics
    """What makes torque of currents."""
    believed: Magnetics
    """What the allocation makes currents of torque by."""
    lag_s: float
    """Time constant of the currents."""
    current_limit_A: float
    """Of the allocation; that of the drive where it is the lower of the two and the model is the true one."""


def knowledge(scenario: ResolvedScenario, files: Files, *, nominal: bool) -> Knowledge:
    """Numbers of a resolved scenario, true or nominal.

    Raises
    ------
    InputError
        The Lagrangian does not know all that the model holds.
    """
    known, section, drive = scenario.nominal, scenario.plant, scenario.drive
    groups = len(files.actuator.groups)
    believed = Magnetics(files.nominal, np.full(groups, known.torque_scale))
    if nominal:
        return Knowledge(
            inertia=np.array(known.inertia_kg_m2),
            weight_moment=0.0,
            viscous_Nm_s=np.array(known.viscous_Nm_s),
            unknown_torque_Nm=np.zeros(3),
            magnetics=believed,
            believed=believed,
            lag_s=known.time_constant_s,
            current_limit_A=known.current_limit_A,
        )
    rotor = _rotor(scenario, files)
    return Knowledge(
        inertia=rotor.inertia,
        weight_moment=rotor.weight_moment,
        viscous_Nm_s=np.array(section.viscous_Nm_s),
        unknown_torque_Nm=np.array(section.modelling_torque_Nm),
        magnetics=Magnetics(files.actuator, np.array(section.group_gain)),
        believed=believed,
        lag_s=drive.lag_s,
        current_limit_A=min(known.current_limit_A, drive.current_limit_A),
    )


def _rotor(scenario: ResolvedScenario, files: Files) -> LagrangianRotor:
    """Rotor whose equations of motion are known in closed form, whichever engine is to move it."""
    section = scenario.plant.model_copy(update={"engine": "lagrangian", "integrator": "RK4"})
    return cast("LagrangianRotor", assembly.rotor_of(scenario.model_copy(update={"plant": section}), files))
