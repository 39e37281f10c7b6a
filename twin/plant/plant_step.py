"""Public step of the plant: rotor, field and friction under given currents, as a pure function.

It is the physics step of the loop with the Lagrangian rotor, without drive, and with the same compiled parts:
torque matrix in the middle of the step, smoothed friction split around a Runge-Kutta step of the rotor. The
step is of second order.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free, compiled, inlined
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.record import Rows
from spheretwin.models.joint_chain import JointChain, torque_on_hinges, update_ideal_motion
from spheretwin.models.kinematics import triple
from spheretwin.models.magnetics import (
    CURVE_ROWS,
    SCRATCH_COLUMNS,
    TorqueModel,
    fill_torque_matrix,
    rotor_torque,
)
from spheretwin.plant.friction import Levels, slow_hinges
from spheretwin.plant.lagrangian_rotor import runge_kutta


class State(NamedTuple):
    """State of the plant."""

    q_rad: Array
    """Hinge angles (3,)."""
    qdot_rad_s: Array
    """Hinge rates (3,)."""


class Parameters(NamedTuple):
    """Everything that the step depends on; `_replace` gives a field another value."""

    inertia_kg_m2: Array
    """Principal moments about the joint centre (3,), payload included; only if the joint is ideal."""
    weight_moment_Nm: float
    """Weight of the payload times its distance from the joint centre; only if the joint is ideal."""
    joint: Rows
    """Array of one `JointChain`: if it is on, its hinges, masses and gravity replace the two fields above."""
    coulomb_Nm: Array
    """Coulomb friction of each hinge (3,), mean of both directions."""
    coulomb_asymmetry: Array
    """Its relative excess towards positive angles (3,), -1 to 1."""
    viscous_Nm_s: Array
    """Viscous friction of each hinge (3,)."""
    friction_smoothing_rad_s: float
    """Rate over which Coulomb friction changes sign."""
    constant_torque_Nm: Array
    """Torque on the hinges (3,) that is subtracted as a disturbance is: constant, and of a spring at 0."""
    spring_Nm_rad: Array
    """Stiffness of the cable about each hinge (3,)."""
    torque_gain: Array
    """Torque of each group over that of the torque matrix (n,): torque scale, gains, remanence."""
    magnetics: TorqueModel
    """Poles, groups and torque curve, with their scatter."""


LONGEST_STEP_s = 1.0


@allocation_free
def _has(values: Array, size: int) -> bool:
    """True if a vector has a number of entries, all finite."""
    has = values.shape[0] == size
    if has:
        for i in range(size):
            has = has and abs(values[i]) < np.inf
    return has


@allocation_free
def _is_finite(joint: JointChain) -> bool:
    """True if all numbers of a general joint are finite; an ideal one uses none of them."""
    total = 0.0
    if joint.on:
        for i in range(3):
            total += 0.0 * joint.gravity[i]
            for j in range(3):
                total += 0.0 * joint.axes[i, j] + 0.0 * joint.points[i, j]
            for j in range(4):
                for k in range(4):
                    total += 0.0 * joint.masses[i, j, k]
    return total == 0.0


@inlined
def _groups(parameters: Parameters) -> int:
    return parameters.magnetics.arrangement[0].group_axes.shape[1]


@inlined
def _lines(parameters: Parameters) -> int:
    return parameters.magnetics.arrangement[0].line_weights.shape[0]


@inlined
def check_parameters(parameters: Parameters) -> None:
    """Check the numbers of parameters; compiled code would read beyond the end of a shorter array.

    Raises
    ------
    InputError
        An array has another length, or a number is not finite or out of its range.
    """
    if parameters.magnetics.arrangement.shape[0] != 1:
        raise InputError("plant: expected magnetics of one arrangement, received others")
    tables, coils = parameters.magnetics.tables, parameters.magnetics.arrangement[0].coils.shape[1]
    if _lines(parameters) > 0 and (tables.curve.shape[0] != CURVE_ROWS or tables.curve.shape[1] != 4):
        raise InputError("plant: expected tables.curve of `torque_model`, received one of another shape")
    if coils > 0 and (min(tables.field.shape[0], tables.field.shape[1]) < 4 or tables.field.shape[2] != 3):
        raise InputError("plant: expected tables.field of `torque_model`, received one of another shape")
    groups, inertia = _groups(parameters), parameters.inertia_kg_m2
    if not (_has(inertia, 3) and inertia[0] > 0 and inertia[1] > 0 and inertia[2] > 0):
        raise InputError("plant: expected inertia_kg_m2 of 3 finite numbers above 0, received others")
    asymmetry = parameters.coulomb_asymmetry
    if not (_has(parameters.coulomb_Nm, 3) and _has(asymmetry, 3) and _has(parameters.viscous_Nm_s, 3)):
        raise InputError(
            "plant: expected coulomb_Nm, coulomb_asymmetry and viscous_Nm_s of 3 finite numbers, received"
            " others"
        )
    if not (_has(parameters.constant_torque_Nm, 3) and _has(parameters.spring_Nm_rad, 3)):
        raise InputError(
            "plant: expected constant_torque_Nm and spring_Nm_rad of 3 finite numbers, received others"
        )
    if not _has(parameters.torque_gain, groups):
        raise InputError("plant: expected torque_gain of one finite number for each group, received others")
    if not (abs(parameters.weight_moment_Nm) < np.inf and 0 < parameters.friction_smoothing_rad_s < np.inf):
        raise InputError(
            "plant: expected a finite weight_moment_Nm, friction_smoothing_rad_s above 0, received others"
        )
    if parameters.joint.shape[0] != 1 or not _is_finite(parameters.joint[0]):
        raise InputError("plant: expected joint as an array of one joint of finite numbers, received another")


@inlined
def _check_state(state: State) -> None:
    if not (_has(state.q_rad, 3) and _has(state.qdot_rad_s, 3)):
        raise InputError("plant: expected q_rad and qdot_rad_s of 3 finite numbers, received others")


@inlined
def _check_load(disturbance: Array, dt: float) -> None:
    if not _has(disturbance, 3):
        raise InputError("plant: expected a disturbance of 3 finite numbers, received others")
    if not 0 < dt <= LONGEST_STEP_s:
        raise InputError("plant: expected a step dt above 0, up to 1 s, received another")


@compiled
def torque_matrix(q: Array, parameters: Parameters) -> Array:
    """Return the torque matrix at a pose: torque on the rotor, stator frame, of one ampere in each group.

    Parameters
    ----------
    q : (3,) array, rad
        Hinge angles; finite.
    parameters : Parameters

    Returns
    -------
    (3, n) array, N·m/A

    Raises
    ------
    InputError
        Angles or parameters of another length, not finite or out of range.
    """
    check_parameters(parameters)
    if not _has(q, 3):
        raise InputError("plant: expected q_rad of 3 finite numbers, received others")
    groups = parameters.torque_gain.shape[0]
    G = np.empty((3, groups))
    scratch = np.empty((_lines(parameters), SCRATCH_COLUMNS))
    _fill(q, parameters, np.empty((3, 3)), G, scratch)
    for j in range(groups):
        for i in range(3):
            G[i, j] *= parameters.torque_gain[j]
    return G


@compiled
def step(state: State, currents: Array, disturbance: Array, parameters: Parameters, dt: float) -> State:
    """Return the state after one step; nothing is changed in place.

    Parameters
    ----------
    state : State
        Finite, away from beta = ±90 degrees.
    currents : (n,) array, A
        Of each group, mean over the step.
    disturbance : (3,) array, N·m
        Generalised torque, subtracted in (1).
    parameters : Parameters
    dt : float, s
        Length of the step.

    Returns
    -------
    State
        Of new arrays. The ends of the workspace are not checked.

    Raises
    ------
    InputError
        An array of another length, or a number that is not finite or out of range; also of the result. The
        checks cost 5 % of a step; `Plants` makes those of its arguments once for many steps.
    """
    check_parameters(parameters)
    _check_state(state)
    _check_load(disturbance, dt)
    if not _has(currents, parameters.torque_gain.shape[0]):
        raise InputError("plant: expected currents of one finite number for each group, received others")
    # As `step_of_checked`: a call with all arrays of the parameters, each counted up and down, takes a third
    # of a step.
    groups = parameters.torque_gain.shape[0]
    G, vectors = np.empty((3, groups)), np.empty((8, max(3, groups)))
    scratch = np.empty((_lines(parameters), SCRATCH_COLUMNS))
    q, qdot = state.q_rad.copy(), state.qdot_rad_s.copy()
    advance(q, qdot, currents, disturbance, parameters, dt, vectors, G, scratch)
    if not (_has(q, 3) and _has(qdot, 3)):
        raise InputError("plant: expected a step with a finite result, received one that diverges")
    return State(q, qdot)


@compiled
def step_of_checked(
    state: State, currents: Array, disturbance: Array, parameters: Parameters, dt: float
) -> State:
    """Return the state after one step of arguments that the caller has checked, as `step` does."""
    groups = parameters.torque_gain.shape[0]
    # Few allocations: with one for each vector the step takes half as long again.
    G, vectors = np.empty((3, groups)), np.empty((8, max(3, groups)))
    scratch = np.empty((_lines(parameters), SCRATCH_COLUMNS))
    q, qdot = state.q_rad.copy(), state.qdot_rad_s.copy()
    advance(q, qdot, currents, disturbance, parameters, dt, vectors, G, scratch)
    return State(q, qdot)


@compiled
def roll_out(
    state: State, currents: Array, disturbance: Array, parameters: Parameters, dt: float, steps: int, q: Array
) -> State:
    """Write the angles that a plant reaches under a sequence of currents, and return its last state.

    Parameters
    ----------
    state : State
        At the start.
    currents : (m, n) array, A
        Of each group, held over some steps.
    disturbance : (3,) array, N·m
    parameters : Parameters
    dt : float, s
        Length of a step.
    steps : int
        Steps under each row of currents.
    q : (m, 3) array, rad
        Result: angles after each row of currents.

    Raises
    ------
    InputError
        As `step`; of the currents only the shape is checked, and the number of steps is at least 0.
    """
    check_parameters(parameters)
    _check_state(state)
    _check_load(disturbance, dt)
    if currents.shape[1] != parameters.torque_gain.shape[0] or q.shape != (currents.shape[0], 3) or steps < 0:
        raise InputError(
            "plant: expected currents (m, groups), q (m, 3) and steps from 0 on, received others"
        )
    groups = parameters.torque_gain.shape[0]
    G, vectors = np.empty((3, groups)), np.empty((8, max(3, groups)))
    scratch = np.empty((_lines(parameters), SCRATCH_COLUMNS))
    present, qdot = state.q_rad.copy(), state.qdot_rad_s.copy()
    for k in range(currents.shape[0]):
        for _ in range(steps):
            advance(present, qdot, currents[k], disturbance, parameters, dt, vectors, G, scratch)
        q[k] = present
    return State(present, qdot)


@inlined
def _levels(parameters: Parameters) -> Levels:
    C, a = triple(parameters.coulomb_Nm), triple(parameters.coulomb_asymmetry)
    forward = C[0] * (1.0 + a[0]), C[1] * (1.0 + a[1]), C[2] * (1.0 + a[2])
    return forward, (C[0] * (1.0 - a[0]), C[1] * (1.0 - a[1]), C[2] * (1.0 - a[2]))


@allocation_free
def advance(
    q: Array,
    qdot: Array,
    currents: Array,
    disturbance: Array,
    parameters: Parameters,
    dt: float,
    vectors: Array,
    G: Array,
    scratch: Array,
) -> None:
    """Advance angles and rates in place, without a field if there are no currents.

    `vectors` (8, n), `G` and `scratch` are working space.
    """
    joint, friction_q, middle_q, torque_S = parameters.joint[0], vectors[3], vectors[4], vectors[5]
    torque_q, effective = vectors[6], vectors[7]
    inertia, (forward, reverse) = triple(parameters.inertia_kg_m2), _levels(parameters)
    viscous, smoothing = triple(parameters.viscous_Nm_s), parameters.friction_smoothing_rad_s
    acts = False
    for i in range(3):
        middle_q[i], friction_q[i] = q[i] + 0.5 * dt * qdot[i], 0.0
        acts = acts or forward[i] > 0 or reverse[i] > 0 or viscous[i] > 0
    if acts:
        slow_hinges(joint, inertia, viscous, (forward, reverse), smoothing, dt, q, qdot, friction_q)
    torque_S[0] = torque_S[1] = torque_S[2] = 0.0
    if currents.shape[0] > 0:
        _fill(middle_q, parameters, vectors, G, scratch)
        for j in range(G.shape[1]):
            effective[j] = parameters.torque_gain[j] * currents[j]
        rotor_torque(G, effective[: G.shape[1]], torque_S)
    torque_on_hinges(joint, middle_q, torque_S, torque_q)
    for i in range(3):
        torque_q[i] -= (
            disturbance[i] + parameters.constant_torque_Nm[i] + parameters.spring_Nm_rad[i] * middle_q[i]
        )
    runge_kutta(dt, joint, inertia, parameters.weight_moment_Nm, triple(torque_q), q, qdot)
    if acts:
        slow_hinges(joint, inertia, viscous, (forward, reverse), smoothing, dt, q, qdot, friction_q)


@allocation_free
def _fill(q: Array, parameters: Parameters, vectors: Array, G: Array, scratch: Array) -> None:
    """Fill `G` without gains at a pose; the first three rows of `vectors` are working space."""
    ideal_q, rates, ideal_rates = vectors[0], vectors[1], vectors[2]
    for i in range(3):
        rates[i] = 0.0
    update_ideal_motion(parameters.joint[0], q, rates, ideal_q, ideal_rates)
    magnetics = parameters.magnetics
    fill_torque_matrix(ideal_q, magnetics.arrangement[0], magnetics.tables, G, scratch)
