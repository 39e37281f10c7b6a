"""Control period of the true plant: from commanded currents to the motion of the rotor."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numba
import numpy as np
from numba import types
from numpy.typing import NDArray

from spheretwin.electronics.drive_chain import advance, begin, end
from spheretwin.models.base.compiled import compiled_callback, copy_into, inlined
from spheretwin.models.base.numba_internals.addresses import function_at
from spheretwin.models.base.record import Rows
from spheretwin.models.joint_chain import torque_on_hinges, update_ideal_motion
from spheretwin.models.magnetics import TorqueModel, fill_torque_matrix, rotor_torque
from spheretwin.plant import lagrangian_rotor, mujoco_rotor
from spheretwin.plant.bristle_friction import apply_bristles, begin_bristles, log_bristles
from spheretwin.plant.friction import slow_down
from spheretwin.plant.magnet_heat import advance_heat, begin_heat
from spheretwin.plant.rotor import EngineKind, RotorData

ENGINES: dict[str, EngineKind] = {
    row.name: row
    for row in (
        mujoco_rotor.MUJOCO,
        lagrangian_rotor.LAGRANGIAN,
    )
}


STEP_SIGNATURE = types.void(numba.typeof(RotorData.zeros()))
"""Step of an engine, whose argument is the array of one rotor; the plant is compiled once for all engines."""

step_at = function_at(STEP_SIGNATURE)


@cache
def engine_step(engine: str) -> Any:
    """Return the step of an engine: a callback of `STEP_SIGNATURE`, in Python a function."""
    step = ENGINES[engine].step

    def step_rotor(rows: Rows) -> None:
        step(rows[0])

    return compiled_callback(STEP_SIGNATURE, step_rotor)


GOING, LEFT_WORKSPACE, DIVERGED, FAILSAFE = 0, 1, 2, 3

# The fastest motion of the rotor within the workspace is some hundred rad/s. A rate above this bound, which
# is far below the engine's own bound of 1e10, means divergence.
FASTEST_RATE_rad_s = 1e6


Array = NDArray[np.float64]


class Plant(NamedTuple):
    """True plant; the controller knows nothing of it."""

    step: Any  # address of the step of the engine, or in Python a function
    rotor: Rows  # array of one RotorData
    magnetics: TorqueModel  # true
    G: NDArray[np.float64]  # (3, n) N·m/A, true torque matrix in the middle of the physics step
    scratch: NDArray[np.float64]  # of `fill_torque_matrix`
    drive: Rows  # array of one DriveChain
    friction: Rows  # array of one Friction
    bristles: Rows  # array of one BristleFriction
    heat: Rows  # array of one MagnetHeat
    group_gain: NDArray[np.float64]  # (n,) torque per ampere over that of the torque matrix
    present_gain: NDArray[np.float64]  # (n,) the same with the present remanence
    unmodelled_torque: NDArray[np.float64]  # (3,) N·m on the hinges (paper: ΔG)
    hinge_range: NDArray[np.float64]  # (3, 2) rad
    substeps: int
    step_s: float
    middle_q: NDArray[np.float64]  # (3,) rad, predicted pose in the middle of the physics step
    middle_qdot: NDArray[np.float64]  # (3,) rad/s, predicted rates there
    coil_q: Array  # (3,) rad, ideal hinges with the same orientation
    coil_qdot: Array  # (3,) rad/s, their rates with the same angular velocity
    last_qdot: NDArray[np.float64]  # (3,) rad/s at the start of the last physics step
    current: NDArray[np.float64]  # (n,) A, present
    mean_current: NDArray[np.float64]  # (n,) A, over the physics step
    effective_current: NDArray[np.float64]  # (n,) A, the mean times the gain
    torque_S: NDArray[np.float64]  # (3,) N·m of the coils, stator frame, in the physics step
    friction_q: NDArray[np.float64]  # (3,) N·m on the hinges, mean over the physics step
    first_friction_q: NDArray[np.float64]  # (3,) the same in the first one of the control period
    draws: NDArray[np.float64]  # standard normal numbers of the tick, of faults and current sensors
    halt: NDArray[np.int64]  # (1,) request of a watchdog to the drive
    current_sensors: Rows  # of CurrentSensors
    fault_modes: NDArray[np.float64]  # of every part that can fail: number of its failure mode, or 0
    fault_start_s: NDArray[np.float64]  # (n,) start of the last fault of each group, s; below 0: none


class PlantOutput(NamedTuple):
    """Currents and torque in a control period: the part of the plant in a telemetry row."""

    current: NDArray[np.float64]  # (n,) A, mean over the first physics step
    mean_current: NDArray[np.float64]  # (n,) A, mean over all physics steps taken
    torque_S: NDArray[np.float64]  # (3,) N·m, in the first physics step


@inlined
def plant_tick(plant: Plant, command: Array, disturbance: Array, output: PlantOutput) -> int:
    """Advance the plant by one control period.

    Each physics step: half of the friction, coil currents and torque, rotor with static friction and cable,
    other half of the friction. The torque matrix, the back-EMF and the spring of the cable are those of the
    predicted pose and rates in the middle of the step. With friction split symmetrically around the rotor's
    step, the whole step is of second order; with static friction, between break-aways and reversals.

    Parameters
    ----------
    plant : Plant
        Changed in place.
    command : (n,) array, A
        Commanded group currents, held over the period.
    disturbance : (3,) array, N·m
        Generalised, subtracted in (1), held over the period.
    output : PlantOutput
        Result.

    Returns
    -------
    int
        `GOING`, `LEFT_WORKSPACE`, `DIVERGED`, or `FAILSAFE` if a coil is too hot.
    """
    # Read from the tuple once, because each access counts a reference. Numba has no tuples of records.
    rotor = plant.rotor[0]
    friction, bristles, joint = plant.friction[0], plant.bristles[0], rotor.joint
    drive, magnetics = plant.drive[0], plant.magnetics
    G, scratch = plant.G, plant.scratch
    q, qdot, torque_q, torque_S = rotor.q, rotor.qdot, rotor.torque_q, plant.torque_S
    middle_q, middle_qdot, last_qdot = plant.middle_q, plant.middle_qdot, plant.last_qdot
    hinge_range, half_step_s = plant.hinge_range, 0.5 * plant.step_s
    current, mean_current, effective_current = plant.current, plant.mean_current, plant.effective_current
    gain, unmodelled, friction_q = plant.present_gain, plant.unmodelled_torque, plant.friction_q
    coil_q, coil_qdot, draws = plant.coil_q, plant.coil_qdot, plant.draws
    begin_heat(plant.heat[0], plant.group_gain, gain, drive.coil)
    begin(drive, command, plant.halt[0], draws)
    for substep in range(plant.substeps):
        for i in range(3):
            middle_q[i] = q[i] + half_step_s * qdot[i]
            middle_qdot[i] = qdot[i] + 0.5 * (qdot[i] - last_qdot[i])
            last_qdot[i] = qdot[i]
            friction_q[i] = 0.0
        slow_down(friction, joint, q, qdot, friction_q)
        update_ideal_motion(joint, middle_q, middle_qdot, coil_q, coil_qdot)
        fill_torque_matrix(coil_q, magnetics, G, scratch)
        advance(drive, substep, coil_q, coil_qdot, G, gain, draws, current, mean_current)
        log_mean_current(mean_current, substep, output.mean_current)
        for j in range(effective_current.shape[0]):
            effective_current[j] = gain[j] * mean_current[j]
        rotor_torque(G, effective_current, torque_S)
        torque_on_hinges(joint, middle_q, torque_S, torque_q)
        for i in range(3):
            torque_q[i] -= disturbance[i] + unmodelled[i]
        begin_bristles(bristles, middle_q, q, qdot, torque_q)
        step_at(plant.step)(plant.rotor)
        apply_bristles(bristles, joint, middle_q, middle_qdot, last_qdot, q, qdot)
        log_bristles(bristles, substep, friction_q)
        slow_down(friction, joint, q, qdot, friction_q)
        if substep == 0:
            copy_into(output.current, 0, mean_current, mean_current.shape[0])
            copy_into(output.torque_S, 0, torque_S, 3)
            copy_into(plant.first_friction_q, 0, friction_q, 3)
        for i in range(3):
            if not abs(qdot[i]) < FASTEST_RATE_rad_s:  # also if it is NaN
                return DIVERGED
        for i in range(3):  # at every step: the stop of a hinge at the end of its range is not simulated
            if not hinge_range[i, 0] <= q[i] <= hinge_range[i, 1]:
                return LEFT_WORKSPACE
    is_cool = end(drive)
    advance_heat(plant.heat[0], drive.coil.temperature_degC, drive.flow.copper_J)
    if not is_cool:
        return FAILSAFE
    return DIVERGED if rotor.warnings > 0 else GOING


@inlined
def log_mean_current(current: NDArray[np.float64], substep: int, mean: NDArray[np.float64]) -> None:
    """Update the mean (n,) over the physics steps of a control period with step number `substep`."""
    share = 1.0 / (substep + 1)
    for j in range(mean.shape[0]):
        before = mean[j] if substep else 0.0
        mean[j] = before + share * (current[j] - before)
