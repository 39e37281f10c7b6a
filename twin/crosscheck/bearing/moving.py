"""Who moves the hinge: the Lagrangian plant under our stage of friction, or MuJoCo under its own."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.compiled import compiled
from spheretwin.models.mjcf import Mjcf, read
from spheretwin.twin.crosscheck.bearing.hinge import (
    DAMPING_RATIO,
    IMPEDANCE,
    LARGEST_IMPEDANCE,
    RISE,
    Hinge,
    STEP_s,
    TIME_CONSTANT_s,
)
from spheretwin.twin.plant.engine import Rotor
from spheretwin.twin.plant.friction import Friction, friction, slow_down
from spheretwin.twin.plant.lagrangian import LagrangianRotor
from spheretwin.twin.plant.stepping import step

Array = NDArray[np.float64]

GAMMA = 2  # the hinge, among (alpha, beta, gamma)


class Motion(NamedTuple):
    """A motion of the hinge, a row a step, and its start."""

    q_rad: Array  # (n + 1,)
    qdot_rad_s: Array  # (n + 1,)


Mover = Callable[[Hinge, float, Array], Motion]
"""Moves a hinge from a rate, rad/s, by torques, N·m, each held over a step."""


def by_stage(actuator: Actuator, hinge: Hinge, rate_rad_s: float, torque_Nm: Array) -> Motion:
    """Motion of the Lagrangian plant under our stage of friction.

    Parameters
    ----------
    actuator : Actuator
        Its inertia is the rotor's.
    hinge : Hinge
    rate_rad_s : float, rad/s
        At the start.
    torque_Nm : (n,) array, N·m
        On the hinge, held over each step.
    """
    rotor = LagrangianRotor(actuator, STEP_s)
    bearing = friction(
        _on_gamma(hinge.coulomb_Nm),
        _on_gamma(hinge.viscous_Nm_s),
        hinge.smoothing_rad_s,
        rotor.inertia,
        STEP_s,
    )
    return _motion(rotor.start(np.zeros(3), _on_gamma(rate_rad_s)), bearing, torque_Nm)


def by_mujoco(mjcf: Path, hinge: Hinge, rate_rad_s: float, torque_Nm: Array) -> Motion:
    """Motion of MuJoCo under its own friction loss and damping; as in `by_stage`.

    Raises
    ------
    InputError
        The model cannot be read.
    """
    kept = read(mjcf)
    rotor = Rotor(_with_bearing(kept, hinge), STEP_s, "RK4", 0.0, 0.0, gravity_m_s2=0.0)
    none = friction(np.zeros(3), np.zeros(3), hinge.smoothing_rad_s, np.ones(3), STEP_s)
    return _motion(rotor.start(np.zeros(3), _on_gamma(rate_rad_s)), none, torque_Nm)


def _with_bearing(kept: Mjcf, hinge: Hinge) -> Mjcf:
    """A model with MuJoCo's friction on γ, under MuJoCo's own defaults whatever the file's options are."""
    model = copy(kept.bare)
    model.dof_frictionloss[GAMMA], model.dof_damping[GAMMA] = hinge.coulomb_Nm, hinge.viscous_Nm_s
    model.dof_solref[GAMMA] = TIME_CONSTANT_s, DAMPING_RATIO
    model.dof_solimp[GAMMA] = IMPEDANCE, LARGEST_IMPEDANCE, *RISE
    model.opt.disableflags, model.opt.enableflags = int(mujoco.mjtDisableBit.mjDSBL_CONTACT), 0
    model.opt.solver, model.opt.iterations = mujoco.mjtSolver.mjSOL_NEWTON, 100
    model.opt.noslip_iterations = 0
    # One constraint is solved in two steps of Newton's, without any: a tolerance would end it before.
    model.opt.tolerance = 0.0
    return replace(kept, bare=model)


def _motion(plant: Any, bearing: Friction, torque_Nm: Array) -> Motion:
    q, qdot = np.empty((2, len(torque_Nm) + 1))
    _follow(plant, bearing, torque_Nm, q, qdot)
    return Motion(q, qdot)


@compiled
def _follow(plant: Any, bearing: Friction, torque_Nm: Array, q: Array, qdot: Array) -> None:
    on_hinges = np.zeros(3)
    q[0], qdot[0] = plant.q[GAMMA], plant.qdot[GAMMA]
    for row in range(torque_Nm.shape[0]):
        plant.torque_q[GAMMA] = torque_Nm[row]
        if bearing.acts:
            slow_down(bearing, plant.q, plant.qdot, on_hinges)
        step(plant)
        if bearing.acts:
            slow_down(bearing, plant.q, plant.qdot, on_hinges)
        q[row + 1], qdot[row + 1] = plant.q[GAMMA], plant.qdot[GAMMA]


def _on_gamma(value: float) -> Array:
    return np.array([0.0, 0.0, value])
