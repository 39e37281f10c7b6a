"""Compiled control period of many episodes: action, physics, observation, reward, end."""

from __future__ import annotations

from math import isfinite, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.policy import write_observation
from spheretwin.electronics.coil import advance_lag
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free, inlined
from spheretwin.models.base.record import Rows
from spheretwin.models.kinematics import Triple
from spheretwin.plant.lanes import LANES, LaneMagnetics, PlantBlock, advance
from spheretwin.plant.plant_tick import FASTEST_RATE_rad_s

RUNNING, LEFT_WORKSPACE, DIVERGED, COMPLETED = 0, 1, 2, 3
STATUS = ("running", "left_workspace", "diverged", "completed")

REWARD_TERMS = ("tracking", "rate", "effort", "failure")


class Episodes(NamedTuple):
    """Episodes in progress, one for each of n plants."""

    tick: NDArray[np.int64]  # (n,) control periods since the start
    variant: NDArray[np.int64]  # (n,)
    code: NDArray[np.int64]  # (n,) `RUNNING`, or how the episode ended
    reference: Array  # (v, ticks + 1, 3, 3)
    disturbance: Array  # (v, ticks, 3) N·m
    hinge_range: Array  # (3, 2) rad
    weights: Array  # (4,) of the terms of the reward
    current: Array  # (n, groups) A
    mean_current: Array  # (n, groups) A, over a physics step
    lag: Rows  # of CurrentLag
    squares: Array  # (n,) rad², sum of squares of the error
    largest: Array  # (n,) rad, largest error


class Physics(NamedTuple):
    """Constants of the physics steps of a control period."""

    step_s: float
    substeps: int
    slows: bool
    by_current: bool
    limit: float  # of an action, N·m or A


@allocation_free
def advance_episodes(
    blocks: Rows,
    magnetics: LaneMagnetics,
    episodes: Episodes,
    physics: Physics,
    actions: Array,
    observations: NDArray[np.float32],
    rewards: Array,
    terms: Array,
) -> int:
    """Advance all episodes by one control period.

    Parameters
    ----------
    blocks, magnetics
        Of `lanes.advance`; blocks are changed.
    episodes : Episodes
        Changed; an episode that has ended stays as it is.
    physics : Physics
    actions : (n, 3) or (n, groups) array, N·m or A
        Cut at the limit.
    observations, rewards, terms : (n, 15), (n,) and (n, 4) arrays
        Result; the reward of an episode that has ended is 0.

    Returns
    -------
    int
        Episodes that ended in this period.
    """
    n, limit = actions.shape[0], physics.limit
    for i in range(n):
        variant, tick = episodes.variant[i], min(episodes.tick[i], episodes.disturbance.shape[1] - 1)
        block, lane = blocks[i // LANES], i % LANES
        for k in range(3):
            torque_Nm = -episodes.disturbance[variant, tick, k] - block.constant_torque_Nm[k * LANES + lane]
            if not physics.by_current:
                torque_Nm += min(max(actions[i, k], -limit), limit)
            block.held_Nm[k * LANES + lane] = torque_Nm
    if physics.by_current:
        for _ in range(physics.substeps):
            for i in range(n):
                advance_lag(episodes.lag[0], actions[i], episodes.current[i], episodes.mean_current[i])
            advance(blocks, magnetics, episodes.mean_current, physics.step_s, 1, physics.slows)
    else:
        no_currents = episodes.mean_current[:0]
        advance(blocks, magnetics, no_currents, physics.step_s, physics.substeps, physics.slows)
    ended = 0
    for i in range(n):
        q, qdot = motion_of(blocks[i // LANES], i % LANES)
        ended += finish(q, qdot, i, episodes, actions[i], limit, rewards, terms[i])
        observe(q, qdot, i, episodes, observations[i])
    return ended


@inlined
def motion_of(block: PlantBlock, lane: int) -> tuple[Triple, Triple]:
    """Return angles and rates of one plant."""
    q, qdot = block.q_rad, block.qdot_rad_s
    return (
        (q[lane], q[LANES + lane], q[2 * LANES + lane]),
        (qdot[lane], qdot[LANES + lane], qdot[2 * LANES + lane]),
    )


@inlined
def finish(
    q: Triple,
    qdot: Triple,
    i: int,
    episodes: Episodes,
    action: Array,
    limit: float,
    rewards: Array,
    terms: Array,
) -> bool:
    """Write reward and terms of episode i after its control period; return True if it ended with it."""
    rewards[i] = 0.0
    for k in range(4):
        terms[k] = 0.0
    if episodes.code[i] != RUNNING:
        return False
    episodes.tick[i] += 1
    episodes.code[i] = _judge(q, qdot, i, episodes)
    _reward(q, qdot, i, episodes, action, limit, terms)
    for k in range(4):
        rewards[i] += terms[k]
    return bool(episodes.code[i] != RUNNING)


@allocation_free
def observe(q: Triple, qdot: Triple, i: int, episodes: Episodes, row: NDArray[np.float32]) -> None:
    """Write the observation of episode i."""
    write_observation(q, qdot, episodes.reference[episodes.variant[i], episodes.tick[i]], row)


@allocation_free
def _judge(q: Triple, qdot: Triple, i: int, episodes: Episodes) -> int:
    """Return how episode i goes on after its control period."""
    for k in range(3):
        if not (isfinite(q[k]) and abs(qdot[k]) < FASTEST_RATE_rad_s):
            return DIVERGED
    for k in range(3):
        if not episodes.hinge_range[k, 0] <= q[k] <= episodes.hinge_range[k, 1]:
            return LEFT_WORKSPACE
    return COMPLETED if episodes.tick[i] == episodes.disturbance.shape[1] else RUNNING


@allocation_free
def _reward(
    q: Triple, qdot: Triple, i: int, episodes: Episodes, action: Array, limit: float, terms: Array
) -> None:
    """Write the terms of the reward, and add to the figures of the episode."""
    weights, code = episodes.weights, episodes.code[i]
    if code not in (RUNNING, COMPLETED):
        terms[3] = -weights[3]
    if code == DIVERGED:
        return
    reference = episodes.reference[episodes.variant[i], episodes.tick[i]]
    angle = rate = effort = 0.0
    for k in range(3):
        angle += (q[k] - reference[0, k]) ** 2
        rate += (qdot[k] - reference[1, k]) ** 2
    for k in range(action.shape[0]):
        effort += (min(max(action[k], -limit), limit) / limit) ** 2
    terms[0], terms[1] = -weights[0] * sqrt(angle) / 0.1, -weights[1] * sqrt(rate) / 10.0
    terms[2] = -weights[2] * effort / action.shape[0]
    episodes.squares[i] += angle
    episodes.largest[i] = max(episodes.largest[i], sqrt(angle))
