"""Compiled step of many plants at a time: a plant in each lane of the vector unit.

The operations and the formulas are those of `plant_step`. The compiler vectorises only loops without
branches and calls, so all numbers of a block of plants are in one vector. The reads of the torque table are
scattered: the field is computed plant by plant.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import allocation_free, inlined
from spheretwin.models.base.record import Rows
from spheretwin.models.base.trigonometry import sine_cosine
from spheretwin.models.kinematics import Triple, Turns
from spheretwin.models.lagrangian import acceleration_entries, inertia_entries
from spheretwin.models.magnetics import Tables, fill_torque_matrix, rotor_torque
from spheretwin.plant.friction import slowed

Array = NDArray[np.float64]

LANES = 16
"""Plants of a block, a constant of the compiled code. Loops over 8 would be unrolled, not vectorised."""

# First number of each quantity in a block. A row has an entry for each plant; most quantities have three.
_TRIPLE = 3 * LANES
Q, QDOT, TORQUE, HELD, INERTIA, COULOMB = (_TRIPLE * place for place in range(6))
VISCOUS, SPRING, MIDDLE_Q, TORQUE_S, ACCELERATION = (_TRIPLE * place for place in range(6, 11))
STAGE_Q, STAGE_QDOT, SUM_Q, SUM_QDOT = (_TRIPLE * place for place in range(11, 15))
COSINE, SINE, REVERSE = (_TRIPLE * place for place in range(15, 18))
WEIGHT, SMOOTHING, ROWS = 54 * LANES, 55 * LANES, 56


class LaneField(NamedTuple):
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
def advance(blocks: Array, field: LaneField, currents: Array, dt: float, steps: int, slows: bool) -> None:
    """Advance all plants under held currents.

    Parameters
    ----------
    blocks : (blocks, ROWS * LANES) array
        Changed in place; HELD has the torque on the hinges besides field, spring and friction.
    field : LaneField
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
        for i in range(TORQUE_S, TORQUE_S + _TRIPLE):
            block[i] = 0.0
        for _ in range(steps):
            _predict(block, dt)
            if slows:
                _slow_down(block, dt)
            for lane in range(plants):
                _compute_field(block, lane, field, first + lane, currents[first + lane])
            _collect_torque(block)
            _step_rotor(block, dt)
            if slows:
                _slow_down(block, dt)


@allocation_free
def roll_out(
    blocks: Array, field: LaneField, currents: Array, dt: float, steps: int, slows: bool, angles: Array
) -> None:
    """Advance all plants under rows of currents (rows, n, groups); write the angles reached (rows, n, 3)."""
    for row in range(currents.shape[0]):
        advance(blocks, field, currents[row], dt, steps, slows)
        for plant in range(currents.shape[1]):
            block, lane = plant // LANES, plant % LANES
            for i in range(3):
                angles[row, plant, i] = blocks[block, Q + i * LANES + lane]


@inlined
def _triple(block: Array, first: int, lane: int) -> Triple:
    return block[first + lane], block[first + LANES + lane], block[first + 2 * LANES + lane]


@inlined
def _turns(block: Array, lane: int) -> Turns:
    ca, cb, cg = _triple(block, COSINE, lane)
    sa, sb, sg = _triple(block, SINE, lane)
    return Turns(ca, sa, cb, sb, cg, sg)


@allocation_free
def _turn(block: Array, pose: int) -> None:
    """Compute cosine and sine of all angles of a pose."""
    for i in range(_TRIPLE):
        block[SINE + i], block[COSINE + i] = sine_cosine(block[pose + i])


@allocation_free
def _predict(block: Array, dt: float) -> None:
    """Predict the pose in the middle of the step."""
    for i in range(_TRIPLE):
        block[MIDDLE_Q + i] = block[Q + i] + 0.5 * dt * block[QDOT + i]


@allocation_free
def _compute_field(block: Array, lane: int, field: LaneField, plant: int, current: Array) -> None:
    """Compute the torque of the coils of one plant in the stator frame."""
    table = field.table_of[plant]
    tables = Tables(field.curves[table], field.fields[table])
    q, effective, torque_S = field.vectors[0], field.vectors[1], field.vectors[2]
    gain, groups = field.torque_gain[plant], field.torque_gain.shape[1]
    for i in range(3):
        q[i] = block[MIDDLE_Q + i * LANES + lane]
    fill_torque_matrix(q, field.arrangement[plant], tables, field.G, field.scratch)
    for j in range(groups):
        effective[j] = gain[j] * current[j]
    rotor_torque(field.G, effective[:groups], torque_S)
    for i in range(3):
        block[TORQUE_S + i * LANES + lane] = torque_S[i]


@allocation_free
def _collect_torque(block: Array) -> None:
    """Compute the torque on the hinges, held over the step: that of the coils as `generalised_torque`."""
    _turn(block, MIDDLE_Q)
    for lane in range(LANES):
        at, (x, y, z) = _turns(block, lane), _triple(block, TORQUE_S, lane)
        block[TORQUE + lane], block[TORQUE + LANES + lane] = x, at.ca * y + at.sa * z
        block[TORQUE + 2 * LANES + lane] = at.sb * x + at.cb * (at.ca * z - at.sa * y)
    for i in range(_TRIPLE):
        block[TORQUE + i] += block[HELD + i] - block[SPRING + i] * block[MIDDLE_Q + i]


@allocation_free
def _step_rotor(block: Array, dt: float) -> None:
    """Advance angles and rates by a Runge-Kutta step, as `lagrangian_rotor.step` does."""
    for i in range(_TRIPLE):
        block[STAGE_Q + i], block[STAGE_QDOT + i] = block[Q + i], block[QDOT + i]
        block[SUM_Q + i] = block[SUM_QDOT + i] = 0.0
    for stage in range(4):
        _turn(block, STAGE_Q)
        _accelerate(block)
        weight = 2.0 if stage == 1 or stage == 2 else 1.0
        time = dt if stage == 2 else 0.5 * dt
        for i in range(_TRIPLE):
            rate, acceleration = block[STAGE_QDOT + i], block[ACCELERATION + i]
            block[SUM_Q + i] += weight * rate
            block[SUM_QDOT + i] += weight * acceleration
            block[STAGE_Q + i] = block[Q + i] + time * rate
            block[STAGE_QDOT + i] = block[QDOT + i] + time * acceleration
    for i in range(_TRIPLE):
        block[Q + i] += dt / 6 * block[SUM_Q + i]
        block[QDOT + i] += dt / 6 * block[SUM_QDOT + i]


@allocation_free
def _accelerate(block: Array) -> None:
    """Compute the accelerations at the stage."""
    for lane in range(LANES):
        alpha, beta, gamma = acceleration_entries(
            _turns(block, lane),
            _triple(block, STAGE_QDOT, lane),
            _triple(block, TORQUE, lane),
            _triple(block, INERTIA, lane),
            block[WEIGHT + lane],
        )
        block[ACCELERATION + lane], block[ACCELERATION + LANES + lane] = alpha, beta
        block[ACCELERATION + 2 * LANES + lane] = gamma


@allocation_free
def _slow_down(block: Array, dt: float) -> None:
    """Advance the rates by half a step under friction alone, as `friction.slow_down` does."""
    t = 0.5 * dt
    _turn(block, Q)
    for lane in range(LANES):
        M = inertia_entries(_turns(block, lane), _triple(block, INERTIA, lane))
        rates = _triple(block, QDOT, lane)
        viscous = _triple(block, VISCOUS, lane)
        coulomb = _triple(block, COULOMB, lane), _triple(block, REVERSE, lane)
        alpha, beta, gamma = slowed(M, rates, viscous, coulomb, block[SMOOTHING + lane], t, False)
        block[QDOT + lane], block[QDOT + LANES + lane] = alpha, beta
        block[QDOT + 2 * LANES + lane] = gamma
