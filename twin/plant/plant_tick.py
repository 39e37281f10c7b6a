"""Control period of the true plant: from commanded currents to the motion of the rotor."""

from __future__ import annotations

from typing import Any, NamedTuple

import numba
from numba import types

from spheretwin.electronics.drive_chain import DriveChain, advance, begin, end
from spheretwin.electronics.transducers import CurrentSensors
from spheretwin.models.base.addresses import caller_of
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import compiled_callback, copy_into, inlined
from spheretwin.models.base.record import Record, field
from spheretwin.models.joint_chain import torque_on_hinges, update_ideal_motion
from spheretwin.models.magnetics import (
    SCRATCH_COLUMNS,
    Arrangement,
    Tables,
    fill_torque_matrix,
    rotor_torque,
)
from spheretwin.plant import lagrangian_rotor, mujoco_rotor
from spheretwin.plant.parts import (
    PlantParts,
    after_step,
    before_step,
    begin_parts,
    end_parts,
    load_rotor,
)
from spheretwin.plant.rotor import EngineKind, RotorData

ENGINES: dict[str, EngineKind] = {
    row.name: row
    for row in (
        mujoco_rotor.MUJOCO,
        lagrangian_rotor.LAGRANGIAN,
    )
}


STEP_SIGNATURE = types.void(numba.from_dtype(RotorData.dtype()))
"""Step of an engine: the plant is compiled once for all engines."""

call_step = caller_of(STEP_SIGNATURE)


def engine_step(engine: str) -> Any:
    """Return the step of an engine: a callback of `STEP_SIGNATURE`, in Python a function."""
    return compiled_callback(STEP_SIGNATURE, ENGINES[engine].step)


GOING, LEFT_WORKSPACE, DIVERGED, FAILSAFE = 0, 1, 2, 3

# The fastest motion of the rotor within the workspace is some hundred rad/s. A rate above this bound, which
# is far below the engine's own bound of 1e10, means divergence.
FASTEST_RATE_rad_s = 1e6


class Plant(Record):
    """True plant; the controller knows nothing of it."""

    rotor: RotorData = field("rotor")
    arrangement: Arrangement = field("true poles and coil groups")
    G: Array = field("true torque matrix in the middle of the physics step", "N·m/A", (3, "groups"))
    scratch: Array = field("working space of `fill_torque_matrix`", "", ("lines", SCRATCH_COLUMNS))
    drive: DriveChain = field("drive")
    parts: Any = field("in the order of `PARTS`", family=PlantParts)
    group_gain: Array = field("torque per ampere over that of the torque matrix", "", "groups", fault=True)
    present_gain: Array = field("the same with the present remanence", "", "groups")
    unmodelled_torque: Array = field("on the hinges (paper: ΔG)", "N·m", 3)
    hinge_range: Array = field("of each hinge", "rad", (3, 2))
    substeps: int = field("physics steps in a control period")
    step_s: float = field("physics step", "s")
    middle_q: Array = field("predicted pose in the middle of the physics step", "rad", 3)
    middle_qdot: Array = field("predicted rates there", "rad/s", 3)
    coil_q: Array = field("ideal hinges with the same orientation", "rad", 3)
    coil_qdot: Array = field("their rates with the same angular velocity", "rad/s", 3)
    joint_q: Array = field(
        "angles of the measured shafts, behind the play of the hinges", "rad", 3, state=True
    )
    last_qdot: Array = field("rates at the start of the last physics step", "rad/s", 3, state=True)
    current: Array = field("present", "A", "groups", state=True)
    mean_current: Array = field("over the physics step", "A", "groups")
    effective_current: Array = field("the mean times the gain", "A", "groups")
    torque_S: Array = field("of the coils, stator frame, in the physics step", "N·m", 3)
    friction_q: Array = field("on the hinges, mean over the physics step", "N·m", 3)
    first_friction_q: Array = field("the same in the first step of the control period", "N·m", 3)
    current_sensors: CurrentSensors = field("sensors of the currents")
    fault_modes: Array = field("of every part that can fail: number of its mode, or 0", "", "parts")
    fault_start_s: Array = field("start of the last fault of a group; below 0: none", "s", "groups")


class PlantOutput(NamedTuple):
    """Currents and torque in a control period: the part of the plant in a telemetry row."""

    current: Array  # (n,) A, mean over the first physics step
    mean_current: Array  # (n,) A, mean over all physics steps taken
    torque_S: Array  # (3,) N·m, in the first physics step


class TickInput(NamedTuple):
    """What acts on the plant in a control period."""

    command: Array  # (n,) A, group currents, held over the period
    disturbance: Array  # (3,) N·m, generalised, subtracted in (1), held over the period
    draws: Array  # standard normal numbers of the tick, of faults and current sensors
    halt: int  # request of a watchdog to the drive


@inlined
def plant_tick(plant: Plant, tables: Tables, step: Any, given: TickInput, output: PlantOutput) -> int:
    """Advance the plant by one control period.

    Each physics step: half of the friction, coil currents and torque, rotor with static friction and cable,
    other half of the friction; friction and heat are `PARTS`. The torque matrix, the back-EMF and the spring
    of the cable are those of the predicted pose and rates in the middle of the step. With friction split
    symmetrically around the rotor's step, the whole step is of second order; with static friction, between
    break-aways and reversals.

    Parameters
    ----------
    plant : Plant
        Changed in place.
    tables : Tables
        Of its magnetics.
    step : address, or in Python function
        Step of the engine.
    given : TickInput
    output : PlantOutput
        Result.

    Returns
    -------
    int
        `GOING`, `LEFT_WORKSPACE`, `DIVERGED`, or `FAILSAFE` if a coil is too hot.
    """
    rotor, drive, parts, draws = plant.rotor, plant.drive, plant.parts, given.draws
    joint, arrangement = rotor.joint, plant.arrangement
    # Slices of fields have the type of other arrays: what takes them is compiled once for all.
    G, scratch, gain = plant.G[:], plant.scratch[:], plant.present_gain[:]
    q, qdot, torque_q, torque_S = rotor.q[:], rotor.qdot[:], rotor.torque_q[:], plant.torque_S[:]
    middle_q, middle_qdot, last_qdot = plant.middle_q[:], plant.middle_qdot[:], plant.last_qdot[:]
    hinge_range, half_step_s = plant.hinge_range, 0.5 * plant.step_s
    current, mean_current, effective_current = (
        plant.current[:],
        plant.mean_current[:],
        plant.effective_current[:],
    )
    unmodelled, friction_q, disturbance = plant.unmodelled_torque, plant.friction_q[:], given.disturbance
    coil_q, coil_qdot = plant.coil_q[:], plant.coil_qdot[:]
    for j in range(gain.shape[0]):
        gain[j] = plant.group_gain[j]
    begin_parts(plant.parts, plant, 0)
    begin(drive, given.command, given.halt, draws)
    for substep in range(plant.substeps):
        for i in range(3):
            middle_q[i] = q[i] + half_step_s * qdot[i]
            middle_qdot[i] = qdot[i] + 0.5 * (qdot[i] - last_qdot[i])
            last_qdot[i] = qdot[i]
            friction_q[i] = 0.0
        before_step(parts, plant, substep)
        update_ideal_motion(joint, middle_q, middle_qdot, coil_q, coil_qdot)
        fill_torque_matrix(coil_q, arrangement, tables, G, scratch)
        advance(drive, substep, coil_q, coil_qdot, G, gain, draws, current, mean_current)
        log_mean_current(mean_current, substep, output.mean_current)
        for j in range(effective_current.shape[0]):
            effective_current[j] = gain[j] * mean_current[j]
        rotor_torque(G, effective_current, torque_S)
        torque_on_hinges(joint, middle_q, torque_S, torque_q)
        for i in range(3):
            torque_q[i] -= disturbance[i] + unmodelled[i]
        load_rotor(parts, plant, substep)
        call_step(step, rotor)
        after_step(parts, plant, substep)
        if substep == 0:
            copy_into(output.current, 0, mean_current, mean_current.shape[0])
            copy_into(output.torque_S, 0, torque_S, 3)
            copy_into(plant.first_friction_q[:], 0, friction_q, 3)
        for i in range(3):
            if not abs(qdot[i]) < FASTEST_RATE_rad_s:  # also if it is NaN
                return DIVERGED
        for i in range(3):  # at every step: the stop of a hinge at the end of its range is not simulated
            if not hinge_range[i, 0] <= q[i] <= hinge_range[i, 1]:
                return LEFT_WORKSPACE
    if not parts.backlash.on:
        copy_into(plant.joint_q[:], 0, q, 3)
    is_cool = end(drive)
    end_parts(parts, plant, 0)
    if not is_cool:
        return FAILSAFE
    return DIVERGED if rotor.warnings > 0 else GOING


@inlined
def log_mean_current(current: Array, substep: int, mean: Array) -> None:
    """Update the mean (n,) over the physics steps of a control period with step number `substep`."""
    share = 1.0 / (substep + 1)
    for j in range(mean.shape[0]):
        before = mean[j] if substep else 0.0
        mean[j] = before + share * (current[j] - before)
