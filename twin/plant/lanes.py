"""Compiled step of many plants at a time: a plant in each lane of the vector unit.

The operations and the formulas are those of `plant_step`. The compiler vectorises only loops without
branches and calls, so all numbers of a block of plants are in one vector. The reads of the torque table are
scattered: the field is computed plant by plant.

Rows of the plant of a run, one after the other, do the same, but on one core of an AMD Zen 5 a physics step
takes 1.35 times as long, with friction 1.7 times, and without a field 5 to 6 times
(`tests/benchmarks/lanes.py`). So environments and windows of identification have lanes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free, inlined
from spheretwin.models.base.record import Record, Rows, field
from spheretwin.models.base.trigonometry import sine_cosine
from spheretwin.models.kinematics import Triple, Turns, triple
from spheretwin.models.lagrangian import acceleration_entries, inertia_entries
from spheretwin.models.magnetics import Tables, fill_torque_matrix, rotor_torque
from spheretwin.plant.friction import slowed

LANES = 16
"""Plants of a block, a constant of the compiled code. Loops over 8 would be unrolled, not vectorised."""

_TRIPLE = 3 * LANES
"""Numbers of a quantity of the three hinges: those of all lanes for alpha, then for beta, then for gamma."""


class PlantBlock(Record):
    """State and parameters of some plants, and working space; a parameter has the name of that of a plant."""

    q_rad: Array = field("hinge angles", "rad", _TRIPLE, state=True)
    qdot_rad_s: Array = field("hinge rates", "rad/s", _TRIPLE, state=True)
    inertia_kg_m2: Array = field("principal moments about the joint centre", "kg·m²", _TRIPLE)
    weight_moment_Nm: Array = field("weight of the payload times its distance", "N·m", LANES)
    forward_Nm: Array = field("Coulomb friction towards positive angles", "N·m", _TRIPLE)
    reverse_Nm: Array = field("the same towards negative angles", "N·m", _TRIPLE)
    viscous_Nm_s: Array = field("viscous friction", "N·m·s", _TRIPLE)
    friction_smoothing_rad_s: Array = field("rate over which Coulomb friction turns", "rad/s", LANES)
    constant_torque_Nm: Array = field("subtracted as a disturbance is, by the caller", "N·m", _TRIPLE)
    spring_Nm_rad: Array = field("stiffness of the cable", "N·m/rad", _TRIPLE)
    held_Nm: Array = field("torque on the hinges besides field, spring and friction", "N·m", _TRIPLE)
    middle_rad: Array = field("predicted pose in the middle of the step", "rad", _TRIPLE)
    torque_S: Array = field("of the coils, stator frame", "N·m", _TRIPLE)
    torque_q: Array = field("on the hinges, held over the step", "N·m", _TRIPLE)
    stage_rad: Array = field("pose of a stage of the Runge-Kutta step", "rad", _TRIPLE)
    stage_rad_s: Array = field("its rates", "rad/s", _TRIPLE)
    stage_rad_s2: Array = field("its accelerations", "rad/s²", _TRIPLE)
    sum_rad_s: Array = field("weighted rates of the stages", "rad/s", _TRIPLE)
    sum_rad_s2: Array = field("their weighted accelerations", "rad/s²", _TRIPLE)
    cosine: Array = field("of the angles of a pose", "", _TRIPLE)
    sine: Array = field("of the same angles", "", _TRIPLE)


class LaneMagnetics(NamedTuple):
    """Magnetics of all plants, and working space."""

    arrangement: Rows  # (n,) of Arrangement
    curves: Array  # (tables, intervals, 4)
    fields: Array  # (tables, t + 2, p + 3, 3)
    table_of: NDArray[np.int64]  # (n,) number of each plant's curve and field
    torque_gain: Array  # (n, groups)
    G: Array  # (3, groups)
    scratch: Array  # (lines, 6)
    vectors: Array  # (3, largest of 3 and groups)


@allocation_free
def advance(
    blocks: Rows, magnetics: LaneMagnetics, currents: Array, dt: float, steps: int, slows: bool
) -> None:
    """Advance all plants under held currents.

    Parameters
    ----------
    blocks : array of PlantBlock
        Changed in place.
    magnetics : LaneMagnetics
    currents : (n, groups) array, A
        Of the first n plants; on the others no field acts.
    dt : float, s
    steps : int
    slows : bool
        False if no plant has friction.
    """
    for number in range(blocks.shape[0]):
        block, first = blocks[number], number * LANES
        plants = min(LANES, currents.shape[0] - first)
        for i in range(_TRIPLE):
            block.torque_S[i] = 0.0
        for _ in range(steps):
            for i in range(_TRIPLE):
                block.middle_rad[i] = block.q_rad[i] + 0.5 * dt * block.qdot_rad_s[i]
            if slows:
                _slow_down(block, dt)
            for lane in range(plants):
                _compute_field(block, lane, magnetics, first + lane, currents[first + lane])
            _collect_torque(block)
            _step_rotor(block, dt)
            if slows:
                _slow_down(block, dt)


@allocation_free
def roll_out(
    blocks: Rows, magnetics: LaneMagnetics, currents: Array, dt: float, steps: int, slows: bool, angles: Array
) -> None:
    """Advance all plants under rows of currents (rows, n, groups); write the angles reached (rows, n, 3)."""
    for row in range(currents.shape[0]):
        advance(blocks, magnetics, currents[row], dt, steps, slows)
        for plant in range(currents.shape[1]):
            angles[row, plant] = _triple(blocks[plant // LANES].q_rad, plant % LANES)


@inlined
def _triple(values: Array, lane: int) -> Triple:
    return values[lane], values[LANES + lane], values[2 * LANES + lane]


@inlined
def _put(values: Array, lane: int, numbers: Triple) -> None:
    values[lane], values[LANES + lane], values[2 * LANES + lane] = numbers


@inlined
def _turns(block: PlantBlock, lane: int) -> Turns:
    (ca, cb, cg), (sa, sb, sg) = _triple(block.cosine, lane), _triple(block.sine, lane)
    return Turns(ca, sa, cb, sb, cg, sg)


@allocation_free
def _turn(block: PlantBlock, pose_rad: Array) -> None:
    """Compute cosine and sine of all angles of a pose."""
    for i in range(_TRIPLE):
        block.sine[i], block.cosine[i] = sine_cosine(pose_rad[i])


@allocation_free
def _compute_field(
    block: PlantBlock, lane: int, magnetics: LaneMagnetics, plant: int, current: Array
) -> None:
    """Compute the torque of the coils of one plant in the stator frame."""
    table, G = magnetics.table_of[plant], magnetics.G
    tables = Tables(magnetics.curves[table], magnetics.fields[table])
    q, effective, torque_S = magnetics.vectors[0], magnetics.vectors[1], magnetics.vectors[2]
    q[0], q[1], q[2] = _triple(block.middle_rad, lane)
    fill_torque_matrix(q, magnetics.arrangement[plant], tables, G, magnetics.scratch)
    gain, groups = magnetics.torque_gain[plant], G.shape[1]
    for j in range(groups):
        effective[j] = gain[j] * current[j]
    rotor_torque(G, effective[:groups], torque_S)
    _put(block.torque_S, lane, triple(torque_S))


@allocation_free
def _collect_torque(block: PlantBlock) -> None:
    """Compute the torque on the hinges, held over the step: that of the coils as `generalised_torque`."""
    _turn(block, block.middle_rad)
    for lane in range(LANES):
        at, (x, y, z) = _turns(block, lane), _triple(block.torque_S, lane)
        _put(
            block.torque_q,
            lane,
            (x, at.ca * y + at.sa * z, at.sb * x + at.cb * (at.ca * z - at.sa * y)),
        )
    for i in range(_TRIPLE):
        block.torque_q[i] += block.held_Nm[i] - block.spring_Nm_rad[i] * block.middle_rad[i]


@allocation_free
def _step_rotor(block: PlantBlock, dt: float) -> None:
    """Advance angles and rates by a Runge-Kutta step, as `lagrangian_rotor.step` does."""
    for i in range(_TRIPLE):
        block.stage_rad[i], block.stage_rad_s[i] = block.q_rad[i], block.qdot_rad_s[i]
        block.sum_rad_s[i] = block.sum_rad_s2[i] = 0.0
    for stage in range(4):
        _turn(block, block.stage_rad)
        _accelerate(block)
        weight = 2.0 if stage == 1 or stage == 2 else 1.0
        time = dt if stage == 2 else 0.5 * dt
        for i in range(_TRIPLE):
            rate, acceleration = block.stage_rad_s[i], block.stage_rad_s2[i]
            block.sum_rad_s[i] += weight * rate
            block.sum_rad_s2[i] += weight * acceleration
            block.stage_rad[i] = block.q_rad[i] + time * rate
            block.stage_rad_s[i] = block.qdot_rad_s[i] + time * acceleration
    for i in range(_TRIPLE):
        block.q_rad[i] += dt / 6 * block.sum_rad_s[i]
        block.qdot_rad_s[i] += dt / 6 * block.sum_rad_s2[i]


@allocation_free
def _accelerate(block: PlantBlock) -> None:
    """Compute the accelerations at the stage."""
    for lane in range(LANES):
        acceleration = acceleration_entries(
            _turns(block, lane),
            _triple(block.stage_rad_s, lane),
            _triple(block.torque_q, lane),
            _triple(block.inertia_kg_m2, lane),
            block.weight_moment_Nm[lane],
        )
        _put(block.stage_rad_s2, lane, acceleration)


@allocation_free
def _slow_down(block: PlantBlock, dt: float) -> None:
    """Advance the rates by half a step under friction alone, as `friction.slow_down` does."""
    _turn(block, block.q_rad)
    for lane in range(LANES):
        M = inertia_entries(_turns(block, lane), _triple(block.inertia_kg_m2, lane))
        rates, viscous = _triple(block.qdot_rad_s, lane), _triple(block.viscous_Nm_s, lane)
        coulomb = _triple(block.forward_Nm, lane), _triple(block.reverse_Nm, lane)
        smoothing = block.friction_smoothing_rad_s[lane]
        _put(block.qdot_rad_s, lane, slowed(M, rates, viscous, coulomb, smoothing, 0.5 * dt, False))
