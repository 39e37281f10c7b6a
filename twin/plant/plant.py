"""One control period of the true plant: from the currents asked for to where the rotor is."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import part_of_its_caller
from spheretwin.models.base.copying import copy_into
from spheretwin.models.magnetics import KeptMatrix, TorqueModel, keep_torque_matrix, rotor_torque
from spheretwin.twin.electronics.driving.stages import Stages, advance_currents, begin, end
from spheretwin.twin.plant.friction import Friction, friction_torque
from spheretwin.twin.plant.stepping import step

GOING, LEFT_WORKSPACE, DIVERGED, FAILSAFE = 0, 1, 2, 3

# The rotor's fastest move within the workspace is some hundred rad/s; far above it, and far below the
# engine's own bound of 1e10, the motion is no longer one.
FASTEST_RATE_rad_s = 1e6


class Plant(NamedTuple):
    """The far side of the wires: nothing of it is known to the controller."""

    rotor: Any  # what compiled code steps, as the engine's row says
    magnetics: TorqueModel  # true
    kept: KeptMatrix
    driving: Stages
    friction: Friction
    group_gain: NDArray[np.float64]  # (n,) torque an ampere over that of the torque matrix
    unmodelled_torque: NDArray[np.float64]  # (3,) N·m on the hinges (paper: ΔG)
    hinge_range: NDArray[np.float64]  # (3, 2) rad
    substeps: int
    current: NDArray[np.float64]  # (n,) A, now
    mean_current: NDArray[np.float64]  # (n,) A, over the physics step
    pulling: NDArray[np.float64]  # (n,) A, the same times the gain
    friction_q: NDArray[np.float64]  # (3,) N·m on the hinges, in the physics step
    first_friction_q: NDArray[np.float64]  # (3,) the same in the first one of the control period
    draws: NDArray[np.float64]  # standard normal numbers of the tick, of faults and of sensors of currents
    current_noise_A: float
    marks: NDArray[np.float64]  # of every part that may fail: the number of its mode, or 0
    began_s: NDArray[np.float64]  # (n,) when the last fault of each group began, s; below 0 where none has


class Delivered(NamedTuple):
    """What acts over the first physics step of a control period: the plant's part of a telemetry row."""

    current: NDArray[np.float64]  # (n,) A
    torque_S: NDArray[np.float64]  # (3,) N·m


@part_of_its_caller
def plant_tick(
    plant: Plant, command: NDArray[np.float64], disturbance: NDArray[np.float64], delivered: Delivered
) -> int:
    """Advance the plant by one control period.

    Each physics step: coil currents, torque of the coils at the true pose, friction, rotor.

    Parameters
    ----------
    plant : Plant
        Changed in place.
    command : (n,) array, A
        Group currents asked for, held over the period.
    disturbance : (3,) array, N·m
        Generalised, subtracted in (1), held over the period.
    delivered : Delivered
        Result.

    Returns
    -------
    int
        `GOING`, `LEFT_WORKSPACE`, `DIVERGED`, or `FAILSAFE` where a coil is too hot.
    """
    # Taken out of the tuple once: each time costs a count of references.
    rotor, magnetics, kept = plant.rotor, plant.magnetics, plant.kept
    q, qdot, torque_S, torque_q = rotor.q, rotor.qdot, rotor.torque_S, rotor.torque_q
    hinge_range = plant.hinge_range
    current, mean_current, pulling = plant.current, plant.mean_current, plant.pulling
    gain, unmodelled, friction, friction_q = (
        plant.group_gain,
        plant.unmodelled_torque,
        plant.friction,
        plant.friction_q,
    )
    driving = plant.driving
    begin(driving, command)
    for substep in range(plant.substeps):
        keep_torque_matrix(q, magnetics, kept)
        advance_currents(driving, command, substep, q, qdot, kept.G, gain, current, mean_current)
        for j in range(pulling.shape[0]):
            pulling[j] = gain[j] * mean_current[j]
        rotor_torque(kept.G, pulling, torque_S)
        for i in range(3):
            torque_q[i] = -disturbance[i] - unmodelled[i]
        if friction.acts:
            friction_torque(friction, q, qdot, friction_q)
            for i in range(3):
                torque_q[i] += friction_q[i]
        if substep == 0:
            copy_into(delivered.current, 0, mean_current, mean_current.shape[0])
            copy_into(delivered.torque_S, 0, torque_S, 3)
            copy_into(plant.first_friction_q, 0, friction_q, 3)
        step(rotor)
        for i in range(3):
            if not abs(qdot[i]) < FASTEST_RATE_rad_s:  # also where it is not a number
                return DIVERGED
        for i in range(3):  # at every step: beyond its range a hinge would meet a stop that is not computed
            if not hinge_range[i, 0] <= q[i] <= hinge_range[i, 1]:
                return LEFT_WORKSPACE
    if not end(driving):
        return FAILSAFE
    for kind in range(rotor.warnings.shape[0]):
        if rotor.warnings[kind] > 0:
            return DIVERGED
    return GOING
