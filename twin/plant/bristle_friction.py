"""Static friction of the three hinges with presliding, and hysteresis of a cable, for both engines.

Model: a generalised Maxwell-slip model [1]. The bearing of a hinge has two massless elements in parallel,
each a spring behind a slider. The spring of element e has the stiffness k_e and the deflection z_e, which
follows the hinge until its slider slips at ``|z_e| = y_e``; then z_e remains at y_e. Both springs have the
same stiffness, and the sliders slip at half and at the whole of `presliding_rad`:

- up to 2/3 of the break-away torque all is elastic: a hinge at rest neither creeps nor drifts;
- above that it has a closed hysteresis loop for every cycle (Masing's rules, return-point memory);
- the last slider slips at exactly the break-away torque, whatever the rate of loading;
- while this slider slips at the rate v, all y_e shrink by the factor ``c + (1 - c) exp(-(v / v_s)**2)``,
  from the break-away torque (1) to the Coulomb level (c).

The rate of *slip* counts for the Stribeck factor, not the rate of the hinge, which is not zero before
break-away. The single-state models are no alternative here. LuGre [2] drifts under loads that oscillate far
below the break-away torque, and its break-away torque falls with the rate of loading. The elasto-plastic
model [3] drifts only above its elastic range, but there its hysteresis loops do not close, unless they are
symmetric; and it approaches the break-away torque asymptotically, at rates at which the Stribeck effect acts
already.

The cable has one element with a constant y. The end stops are solved together with the elements.

[1] F. Al-Bender, V. Lampaert, J. Swevers, "The generalized Maxwell-slip model", IEEE Trans. Autom. Control
50(11), 2005. [2] C. Canudas de Wit, H. Olsson, K. J. Åström, P. Lischinsky, "A new model for control of
systems with friction", IEEE Trans. Autom. Control 40(3), 1995. [3] P. Dupont, V. Hayward, B. Armstrong, F.
Altpeter, "Single state elastoplastic friction models", IEEE Trans. Autom. Control 47(5), 2002.
"""

from __future__ import annotations

from math import exp
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.electronics.random_streams import Seed
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free, copy_into, inlined
from spheretwin.models.base.record import Record, Rows, field, put
from spheretwin.models.joint_chain import JointChain, inertia_at
from spheretwin.models.kinematics import triple
from spheretwin.models.lagrangian import InertiaEntries, solve_inertia
from spheretwin.plant.cable import CableSection, acts, constant_torque_Nm
from spheretwin.plant.end_stops import EndStops, fill_end_stops, store_stop, with_stop
from spheretwin.plant.friction import momentum
from spheretwin.plant.plant_part import PlantPart, PlantSetup

SLIP_SHARES = 0.5, 1.0
"""Slip of the sliders of the bearing over `presliding_rad`."""
LAST, CABLE, ELEMENTS = 1, 2, 3
"""Elements: the slider of the bearing that slips last, and the cable; their number."""

# Rows of `BristleFriction.trial`: pose and rates at the start of the rotor's step; Stribeck factors, rates,
# rotations at its end; torques against these and their slopes.
START, START_RATE, FACTOR, RATE, TRAVEL, TORQUE, SLOPE = range(7)

# Newton's method ends after one or two steps; where it cycles between two branches, steps with secants, which
# cannot cycle, replace it. These converge by a constant factor: for a break-away torque of 3 N·m in 1 µrad
# by 0.7, in 136 steps.
NEWTON_STEPS, MOST_STEPS, TOLERANCE = 10, 300, 1e-13

# A slider slips if its deflection equals the limit of the last step, up to rounding.
_SLIPS = 1.0 - 1e-9


class StictionSection(BaseModel):
    """Static friction of the hinges."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    on: bool = Field(
        False,
        description="static friction with presliding and Stribeck effect replaces the smoothed Coulomb"
        " friction; its level in sliding is plant.coulomb_Nm, and viscous friction is the same",
    )
    break_away: Annotated[float, Field(ge=1, le=10)] = Field(
        1.5, description="break-away torque of each hinge over plant.coulomb_Nm"
    )
    presliding_rad: Annotated[float, Field(ge=1e-9, le=1)] = Field(
        1e-3, description="rotation from the unloaded hinge to break-away, rad; elastic up to half of it"
    )
    damping_ratio: Annotated[float, Field(ge=0, le=10)] = Field(
        0.3, description="damping of the elastic motion about a hinge at rest, over critical damping"
    )
    stribeck_rad_s: Annotated[float, Field(ge=1e-6, le=1e3)] = Field(
        0.05, description="rate of slip with 1/e of the excess of break-away over Coulomb torque, rad/s"
    )


class BristleFriction(Record):
    """Elements of the hinges with their state; the first index is the element, the second the hinge."""

    on: bool = field("whether there is static friction, a cable or an end stop")
    stiffness_Nm_rad: Array = field("stiffness", "N·m/rad", (3, 3))
    damping_Nm_s: Array = field("damping, only as long as an element does not slip", "N·m·s", (3, 3))
    slip_rad: Array = field("largest deflection", "rad", 3)
    asymmetry: Array = field("relative excess of the slip of a bearing towards positive angles", "", 3)
    coulomb_share: float = field("Coulomb level over break-away torque")
    stribeck_rad_s: float = field("rate of slip with 1/e of the excess", "rad/s")
    spring: Array = field("stiffness of the cable, its neutral pose, its constant torque", "", (3, 3))
    implicitness: float = field("1/2 to 1")
    step_s: float = field("physics step", "s")
    deflection_rad: Array = field("deflection", "rad", (3, 3), state=True)
    stribeck_factor: Array = field("factor of each hinge at the end of the last step", "", 3, state=True)
    torque_q: Array = field("against bearing and cable, mean over the last step", "N·m", (2, 3), state=True)
    spring_q: Array = field("spring and constant torque of the cable on the hinges", "N·m", 3)
    first_cable_q: Array = field("cable on the hinges, in the first step of the control period", "N·m", 3)
    trial: Array = field("rows of the present step: START and following", "", (7, 3))
    stops: EndStops = field("end stops, solved together with the elements")


def fill_bristles(
    bristles: Rows,
    stiction: StictionSection,
    coulomb_Nm: ArrayLike,
    cable: CableSection,
    inertia: Array,
    step_s: ArrayLike,
    seed: Seed = 0,
    asymmetry: ArrayLike = (0.0, 0.0, 0.0),
) -> None:
    """Fill the elements of the hinges (alpha, beta, gamma), all without deflection.

    Parameters
    ----------
    bristles : array of BristleFriction
        With their end stops; all other numbers are 0.
    stiction : StictionSection
    coulomb_Nm : (3,) tuple or (n, 3) array, N·m
        Coulomb level.
    cable : CableSection
    inertia : (3,) or (n, 3) array, kg·m²
        Principal inertias about the joint centre, modelling error and payload included.
    step_s : float or (n, 1) array, s
        Physics step.
    seed : int or (n, 1) array
        Seed of the run, for the constant torque of the cable.
    asymmetry : (3,) or (n, 3) array
        Relative excess of break-away and Coulomb torque towards positive angles.
    """
    slip, stiffness = bristles["slip_rad"], bristles["stiffness_Nm_rad"]
    damping, spring = bristles["damping_Nm_s"], bristles["spring"]
    slip[:, :CABLE] = stiction.presliding_rad * np.array(SLIP_SHARES)
    slip[:, CABLE:] = cable.hysteresis_rad
    break_away_Nm = np.where(stiction.on, stiction.break_away * np.asarray(coulomb_Nm), 0.0)
    stiffness[:, :CABLE] = break_away_Nm[..., None, :] / slip[:, :CABLE].sum(axis=1)[:, None, None]
    stiffness[:, CABLE] = np.divide(cable.hysteresis_Nm, cable.hysteresis_rad)
    # Critical damping is 2 sqrt(k J); each element of the bearing has its share.
    each, ratio = np.asarray(inertia)[..., None, :], np.asarray(stiction.damping_ratio)[..., None]
    damping[:, :CABLE] = ratio * np.sqrt(2.0 * stiffness[:, :CABLE] * each)
    # Squares of step times natural frequency, and of step times decay, at most.
    least = np.min(inertia, axis=-1, keepdims=True)
    stiff = np.square(step_s) * stiffness.sum(axis=1).max(axis=1, keepdims=True) / least
    stiff = stiff + np.square(step_s * damping.sum(axis=1).max(axis=1, keepdims=True) / least)
    torques = cable.stiffness_Nm_rad, cable.neutral_rad, constant_torque_Nm(cable, seed)
    for kind, values in enumerate(torques):
        spring[:, kind] = values
    put(
        bristles,
        on=stiction.on | acts(cable) | bristles["stops"]["on"][:, None],
        asymmetry=asymmetry,
        coulomb_share=1.0 / stiction.break_away,
        stribeck_rad_s=stiction.stribeck_rad_s,
        implicitness=0.5 + 0.5 * stiff / (stiff + 4.0),
        step_s=step_s,
        stribeck_factor=1.0,
    )


@inlined
def begin_bristles(
    bristles: BristleFriction, middle_q: Array, q: Array, qdot: Array, torque_q: Array
) -> None:
    """Store pose and rates (3,) at the start of the rotor's step; add the cable and the last torque.

    With the pose that is predicted for the middle of the step, q + h qdot / 2, and the torque held over the
    step, the spring of the cable is of second order and preserves phase volume: it gains and loses no energy
    on average. It is stable for a step below 2 sqrt(J / stiffness).
    """
    if not bristles.on:
        return
    for i in range(3):
        bristles.trial[START, i], bristles.trial[START_RATE, i] = q[i], qdot[i]
        stretch = middle_q[i] - bristles.spring[1, i]
        bristles.spring_q[i] = bristles.spring[2, i] - bristles.spring[0, i] * stretch
        torque_q[i] += bristles.spring_q[i] - bristles.torque_q[0, i] - bristles.torque_q[1, i]


@allocation_free  # not inlined: Newton's method would be compiled into each of its callers
def apply_bristles(
    bristles: BristleFriction,
    joint: JointChain,
    middle_q: Array,
    middle_qdot: Array,
    last_qdot: Array,
    q: Array,
    qdot: Array,
) -> None:
    """Correct the rotor's step for the change of the torque of the elements, if there are any.

    Parameters
    ----------
    bristles : BristleFriction
        Its state is advanced by one physics step, `torque_q` is set.
    joint : JointChain
        Its inertia counts.
    middle_q, middle_qdot : (3,) arrays, rad and rad/s
        Predicted pose and rates in the middle of the physics step.
    last_qdot : (3,) array, rad/s
        Rates at its start; twice the middle ones less these are those at its end, for the Stribeck factor.
    q, qdot : (3,) arrays, rad and rad/s
        At the end of the rotor's step without this torque; corrected in place.

    Notes
    -----
    The rotor's step, with the torque F' of the last step, gives trial rates v* and a trial rotation d*. With
    the inertia matrix M in the middle of the step h, rates v and rotations d at its end solve

        M (v - v*) = -h (F(d) - F'),    d = d* + h (v - v*) / 2 + (g - 1/2) h (v - v0).

    As F - F' is of first order in the step, so is the part of the motion that the rotor's step does not see,
    and the whole step is of second order within presliding. In the steps in which a slider breaks away or
    sticks again, the instant is not found: a motion that reverses is of first order. For constant M the
    result does not depend on F'.

    F is the mean torque over the path from 0 to d, which is integrated in closed form. For g = 1/2 this is
    the mean-value discrete gradient: exact work and second order. For large stiffness g rises to 1, as for
    implicit Euler (L-stable): g - 1/2 is of second order in the step. F rises with d, so that the solution is
    unique. Deflections follow the pose itself: at rest ``v = 0, d = 0`` is an exact solution, without drift.

    Without other torques and for constant M the sum of kinetic energy and energy of the springs never rises.
    Its change is
    ``-F.d + (energy of the springs) - (g - 1/2) h**2 F.M**-1 F``, and the work F.d is at least what the
    springs store: an implicit spring, damping and slip take energy, and a smaller slip deflection releases it
    as heat.
    """
    if not bristles.on:
        return
    h, g, trial, former = bristles.step_s, bristles.implicitness, bristles.trial, bristles.torque_q
    M = inertia_at(joint, triple(joint.inertia), triple(middle_q))
    for i in range(3):
        trial[FACTOR, i] = _stribeck_factor(bristles, i, 2.0 * middle_qdot[i] - last_qdot[i])
        trial[RATE, i] = qdot[i]
    for iteration in range(MOST_STEPS):
        for i in range(3):
            implicit = (g - 0.5) * (trial[RATE, i] - trial[START_RATE, i])
            correction = 0.5 * (trial[RATE, i] - qdot[i]) + implicit
            trial[TRAVEL, i] = q[i] - trial[START, i] + h * correction
            trial[TORQUE, i], trial[SLOPE, i] = _hinge_torque(bristles, i, iteration >= NEWTON_STEPS)
        F0, F1, F2 = trial[TORQUE, 0], trial[TORQUE, 1], trial[TORQUE, 2]
        k0, k1, k2 = trial[SLOPE, 0], trial[SLOPE, 1], trial[SLOPE, 2]
        behind = qdot[0] - trial[RATE, 0], qdot[1] - trial[RATE, 1], qdot[2] - trial[RATE, 2]
        p = momentum(M, behind, joint.on)
        residual = (
            p[0] - h * (F0 - former[0, 0] - former[1, 0]),
            p[1] - h * (F1 - former[0, 1] - former[1, 1]),
            p[2] - h * (F2 - former[0, 2] - former[1, 2]),
        )
        a, b, c = M.alpha + g * h * h * k0, M.beta + g * h * h * k1, M.gamma + g * h * h * k2
        stiff = InertiaEntries(a, b, c, M.alpha_beta, M.alpha_gamma, M.beta_gamma)
        change = solve_inertia(stiff, residual, joint.on)
        largest, size = 0.0, 0.0
        for i in range(3):
            trial[RATE, i] += change[i]
            largest = max(largest, abs(change[i]))
            size = max(size, abs(trial[RATE, i]), abs(qdot[i]))
        if largest <= TOLERANCE * size:
            break
    for i in range(3):
        factor, travel = trial[FACTOR, i], trial[TRAVEL, i]
        bristles.torque_q[0, i] = bristles.torque_q[1, i] = 0.0
        for element in range(ELEMENTS):
            torque, _, deflection = _element(bristles, element, i, travel, factor)
            bristles.torque_q[element // CABLE, i] += torque
            bristles.deflection_rad[element, i] = deflection
        store_stop(bristles.stops, i, trial[START, i], travel)
        bristles.stribeck_factor[i] = factor
        q[i], qdot[i] = trial[START, i] + travel, trial[RATE, i]


@inlined
def log_bristles(bristles: BristleFriction, substep: int, friction_q: Array) -> None:
    """Add the friction of the bearings in a physics step to (3,), N·m; keep the cable's in the first one."""
    if not bristles.on:
        return
    for i in range(3):
        friction_q[i] -= bristles.torque_q[0, i]
        if substep == 0:
            bristles.first_cable_q[i] = bristles.spring_q[i] - bristles.torque_q[1, i]


@inlined
def log_presliding(bristles: BristleFriction, row: Array) -> None:
    """Write the elastic rotation within static friction into the beginning of a row."""
    copy_into(row, 0, bristles.deflection_rad[LAST], 3)


@inlined
def log_cable(bristles: BristleFriction, row: Array) -> None:
    """Write the torque of the cable into the beginning of a row."""
    copy_into(row, 0, bristles.first_cable_q, 3)


@inlined
def log_end_stops(bristles: BristleFriction, row: Array) -> None:
    """Write the torque of the end stops into the beginning of a row."""
    copy_into(row, 0, bristles.stops.torque_q, 3)


@inlined
def _stribeck_factor(bristles: BristleFriction, hinge: int, rate: float) -> float:
    """Return the factor of the slip deflections of a bearing at the end of the step; 1 unless it slips."""
    deflection = bristles.deflection_rad[LAST, hinge]
    slip = bristles.slip_rad[LAST] * bristles.stribeck_factor[hinge]
    slip *= _excess(bristles, hinge, deflection)
    if abs(deflection) < _SLIPS * slip or deflection * rate <= 0.0:
        return 1.0
    share, ratio = bristles.coulomb_share, rate / bristles.stribeck_rad_s
    return share + (1.0 - share) * exp(-ratio * ratio)


@inlined
def _excess(bristles: BristleFriction, hinge: int, direction: float) -> float:
    """Return the slip of a bearing in a direction over the mean of both directions."""
    return 1.0 + bristles.asymmetry[hinge] if direction > 0.0 else 1.0 - bristles.asymmetry[hinge]


@inlined
def _hinge_torque(bristles: BristleFriction, hinge: int, secant: bool) -> tuple[float, float]:
    """Return the mean torque against the trial rotation, N·m, and its slope or secant, N·m/rad."""
    torque, slope = 0.0, 0.0
    factor, travel = bristles.trial[FACTOR, hinge], bristles.trial[TRAVEL, hinge]
    for element in range(ELEMENTS):
        own, own_slope, _ = _element(bristles, element, hinge, travel, factor)
        if secant and travel != 0.0:
            at_rest, _, _ = _element(bristles, element, hinge, 0.0, factor)
            own_slope = max((own - at_rest) / travel, 0.0)
        torque, slope = torque + own, slope + own_slope
    return with_stop(bristles.stops, hinge, bristles.trial[START, hinge], travel, secant, torque, slope)


@inlined
def _element(
    bristles: BristleFriction, element: int, hinge: int, travel: float, factor: float
) -> tuple[float, float, float]:
    """Return mean torque and slope of an element for a rotation, and its deflection after that."""
    g, stiffness = bristles.implicitness, bristles.stiffness_Nm_rad[element, hinge]
    if stiffness == 0.0:
        return 0.0, 0.0, 0.0
    damping = bristles.damping_Nm_s[element, hinge] / bristles.step_s
    sign = 1.0 if travel >= 0.0 else -1.0
    slip = last_slip = other_slip = bristles.slip_rad[element]
    if element < CABLE:
        excess = _excess(bristles, hinge, sign)
        slip, last_slip = factor * slip * excess, bristles.stribeck_factor[hinge] * slip * excess
        other_slip *= factor * _excess(bristles, hinge, -sign)
    start, length = max(sign * bristles.deflection_rad[element, hinge], -other_slip), abs(travel)
    free = slip - start
    if length <= free:  # it sticks
        torque, slope, end = (
            stiffness * (start + g * length) + damping * length,
            stiffness * g + damping,
            start + length,
        )
    elif start >= _SLIPS * last_slip:  # it slips from the start, and its limit may fall
        share = min(length / -free, 1.0) if free < 0.0 else 1.0
        torque = stiffness * (slip - (1.0 - g) * free * share)
        return sign * torque, stiffness * (1.0 - g) if share < 1.0 else 0.0, sign * slip
    else:  # it begins to slip
        free = max(free, 0.0)
        share = free / length if length > 0.0 else 0.0  # at rest, below a limit that has fallen
        torque = stiffness * (slip - (1.0 - g) * free * share) + damping * free
        slope, end = stiffness * (1.0 - g) * share * share, slip
    if torque > stiffness * slip:
        torque, slope = stiffness * slip, 0.0
    return sign * torque, slope, sign * end


@inlined
def _load(bristles: BristleFriction, plant: Any, substep: int) -> None:
    rotor = plant.rotor
    begin_bristles(bristles, plant.middle_q[:], rotor.q[:], rotor.qdot[:], rotor.torque_q[:])


@inlined
def _correct(bristles: BristleFriction, plant: Any, substep: int) -> None:
    rotor, middle_q, middle_qdot = plant.rotor, plant.middle_q[:], plant.middle_qdot[:]
    apply_bristles(
        bristles, rotor.joint, middle_q, middle_qdot, plant.last_qdot[:], rotor.q[:], rotor.qdot[:]
    )
    log_bristles(bristles, substep, plant.friction_q[:])


def _fill(rows: Rows, setup: PlantSetup) -> None:
    section, range_rad = setup.scenario.plant, setup.actuator.hinge_range_rad
    inertia, step_s = setup.rotor["joint"]["inertia"], section.step_s
    fill_end_stops(rows["stops"], section.end_stops, range_rad, inertia, step_s)
    seed = setup.scenario.seed
    coulomb_Nm, asymmetry = section.coulomb_Nm, section.coulomb_asymmetry
    fill_bristles(rows, section.stiction, coulomb_Nm, section.cable, inertia, step_s, seed, asymmetry)


BRISTLES = PlantPart(BristleFriction, _fill, load=_load, after=_correct)
