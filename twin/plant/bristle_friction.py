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

The cable has one element with a constant y.

[1] F. Al-Bender, V. Lampaert, J. Swevers, "The generalized Maxwell-slip model", IEEE Trans. Autom. Control
50(11), 2005. [2] C. Canudas de Wit, H. Olsson, K. J. Åström, P. Lischinsky, "A new model for control of
systems with friction", IEEE Trans. Autom. Control 40(3), 1995. [3] P. Dupont, V. Hayward, B. Armstrong, F.
Altpeter, "Single state elastoplastic friction models", IEEE Trans. Autom. Control 47(5), 2002.
"""

from __future__ import annotations

from math import exp
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.lagrangian import InertiaEntries, inertia_entries, solve_inertia, triple, turns
from spheretwin.plant.cable import CableSection

Array = NDArray[np.float64]

# Slip of the sliders of the bearing over `presliding_rad`.
SLIP_SHARES = 0.5, 1.0
LAST, CABLE = 1, 2
"""Elements: the slider of the bearing that slips last, and the cable."""
ELEMENTS = 3

# Newton's method ends after one or two steps; where it cycles between two branches, steps with secants, which
# cannot cycle, replace it.
NEWTON_STEPS, MOST_STEPS = 10, 60
TOLERANCE = 1e-13

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
        1e-3,
        description="rotation from the unloaded hinge to break-away, rad; elastic up to half of it, at 2/3 of"
        " the break-away torque",
    )
    damping_ratio: Annotated[float, Field(ge=0, le=10)] = Field(
        0.3,
        description="damping of the elastic motion of the rotor about a hinge at rest, over critical damping",
    )
    stribeck_rad_s: Annotated[float, Field(ge=1e-6, le=1e3)] = Field(
        0.05,
        description="rate of slip, rad/s, at which 1/e of the difference between break-away and Coulomb"
        " torque is left",
    )


class BristleFriction(NamedTuple):
    """Elements of a run with their state, for compiled code; the first index is the element."""

    on: bool  # false if there is neither static friction nor a cable with hysteresis: no cost
    stiffness_Nm_rad: Array  # (3, 3) by hinge
    damping_Nm_s: Array  # (3, 3) by hinge, only as long as an element does not slip
    slip_rad: Array  # (3,) largest deflection
    coulomb_share: float  # Coulomb level over break-away torque
    stribeck_rad_s: float
    implicitness: float  # 1/2 to 1
    inertia: Array  # (3,) kg·m² about the joint centre, modelling error and payload included
    step_s: float
    deflection_rad: Array  # (3, 3) state: by hinge
    stribeck_factor: Array  # (3,) state: of each hinge at the end of the last step
    start_q: Array  # (3,) pose at the start of the step
    start_qdot: Array  # (3,)
    torque_q: (
        Array  # (2, 3) N·m state: torque of bearing and cable, against the motion, mean over the last step
    )

    def state_arrays(self) -> tuple[Array, ...]:
        """Return the arrays that hold the state."""
        return self.deflection_rad, self.stribeck_factor, self.torque_q


def bristle_friction(
    stiction: StictionSection,
    coulomb_Nm: tuple[float, ...],
    cable: CableSection,
    inertia: Array,
    step_s: float,
) -> BristleFriction:
    """Return the elements of the hinges (alpha, beta, gamma), all without deflection.

    Parameters
    ----------
    stiction : StictionSection
    coulomb_Nm : (3,) tuple, N·m
        Coulomb level.
    cable : CableSection
    inertia : (3,) array, kg·m²
        Principal inertias about the joint centre, modelling error and payload included.
    step_s : float, s
        Physics step.
    """
    break_away = stiction.break_away * np.array(coulomb_Nm) * stiction.on
    slip = np.array([*SLIP_SHARES, 0.0]) * stiction.presliding_rad
    slip[CABLE] = cable.hysteresis_rad
    stiffness = np.zeros((ELEMENTS, 3))
    stiffness[:CABLE] = break_away / slip[:CABLE].sum()
    stiffness[CABLE] = np.array(cable.hysteresis_Nm) / cable.hysteresis_rad
    damping = np.zeros((ELEMENTS, 3))
    # Critical damping is 2 sqrt(k J); each element has its share.
    damping[:CABLE] = stiction.damping_ratio * np.sqrt(2.0 * stiffness[:CABLE] * inertia)
    # Squares of step times natural frequency, and of step times decay, at most.
    stiff = step_s**2 * stiffness.sum(axis=0).max() / inertia.min()
    stiff += (step_s * damping.sum(axis=0).max() / inertia.min()) ** 2
    return BristleFriction(
        on=bool(stiffness.any()),
        stiffness_Nm_rad=stiffness,
        damping_Nm_s=damping,
        slip_rad=slip,
        coulomb_share=1.0 / stiction.break_away,
        stribeck_rad_s=stiction.stribeck_rad_s,
        implicitness=0.5 + 0.5 * stiff / (stiff + 4.0),
        inertia=np.array(inertia, dtype=np.float64),
        step_s=float(step_s),
        deflection_rad=np.zeros((ELEMENTS, 3)),
        stribeck_factor=np.ones(3),
        start_q=np.zeros(3),
        start_qdot=np.zeros(3),
        torque_q=np.zeros((2, 3)),
    )


@allocation_free
def begin_bristles(bristles: BristleFriction, q: Array, qdot: Array, torque_q: Array) -> None:
    """Store pose and rates (3,) at the start of the rotor's step, and apply the last torque in it."""
    for i in range(3):
        bristles.start_q[i], bristles.start_qdot[i] = q[i], qdot[i]
        torque_q[i] -= bristles.torque_q[0, i] + bristles.torque_q[1, i]


@allocation_free
def apply_bristles(
    bristles: BristleFriction, middle_q: Array, middle_qdot: Array, last_qdot: Array, q: Array, qdot: Array
) -> None:
    """Correct the rotor's step for the change of the torque of the elements.

    Parameters
    ----------
    bristles : BristleFriction
        Its state is advanced by one physics step, `torque_q` is set.
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
    and the whole step is of second order. For constant M the result does not depend on F'.

    F is the mean torque over the path from 0 to d, which is integrated in closed form. For g = 1/2 this is
    the mean-value discrete gradient: exact work and second order. For large stiffness g rises to 1, as for
    implicit Euler (L-stable): g - 1/2 is of second order in the step. F rises with d, so that the solution is
    unique.
    Deflections follow the pose itself: at rest ``v = 0, d = 0`` is an exact solution, and nothing drifts.

    Without other torques the sum of kinetic energy and energy of the springs never rises. Its change is
    ``-F.d + (energy of the springs) - (g - 1/2) h**2 F.M**-1 F``, and the work F.d is at least what the
    springs store: an implicit spring, damping and slip take energy, and a smaller slip deflection releases it
    as heat.
    """
    h, g = bristles.step_s, bristles.implicitness
    trial, before = triple(qdot), triple(bristles.start_qdot)
    M = inertia_entries(turns(triple(middle_q)), triple(bristles.inertia))
    factors = (
        _stribeck_factor(bristles, 0, 2.0 * middle_qdot[0] - last_qdot[0]),
        _stribeck_factor(bristles, 1, 2.0 * middle_qdot[1] - last_qdot[1]),
        _stribeck_factor(bristles, 2, 2.0 * middle_qdot[2] - last_qdot[2]),
    )
    first = (
        q[0] - bristles.start_q[0] - h * (0.5 * trial[0] + (g - 0.5) * before[0]),
        q[1] - bristles.start_q[1] - h * (0.5 * trial[1] + (g - 0.5) * before[1]),
        q[2] - bristles.start_q[2] - h * (0.5 * trial[2] + (g - 0.5) * before[2]),
    )
    former = (
        bristles.torque_q[0, 0] + bristles.torque_q[1, 0],
        bristles.torque_q[0, 1] + bristles.torque_q[1, 1],
        bristles.torque_q[0, 2] + bristles.torque_q[1, 2],
    )
    v0, v1, v2 = trial
    for iteration in range(MOST_STEPS):
        secant = iteration >= NEWTON_STEPS
        F0, k0 = _hinge_torque(bristles, 0, first[0] + g * h * v0, factors[0], secant)
        F1, k1 = _hinge_torque(bristles, 1, first[1] + g * h * v1, factors[1], secant)
        F2, k2 = _hinge_torque(bristles, 2, first[2] + g * h * v2, factors[2], secant)
        e0, e1, e2 = trial[0] - v0, trial[1] - v1, trial[2] - v2
        residual = (
            M.alpha * e0 + M.alpha_beta * e1 + M.alpha_gamma * e2 - h * (F0 - former[0]),
            M.alpha_beta * e0 + M.beta * e1 - h * (F1 - former[1]),
            M.alpha_gamma * e0 + M.gamma * e2 - h * (F2 - former[2]),
        )
        hh = g * h * h
        slopes = InertiaEntries(
            M.alpha + hh * k0, M.beta + hh * k1, M.gamma + hh * k2, M.alpha_beta, M.alpha_gamma
        )
        s0, s1, s2 = solve_inertia(slopes, residual)
        v0, v1, v2 = v0 + s0, v1 + s1, v2 + s2
        size = max(abs(v0), abs(v1), abs(v2), abs(trial[0]), abs(trial[1]), abs(trial[2]))
        if max(abs(s0), abs(s1), abs(s2)) <= TOLERANCE * size:
            break
    _advance(bristles, 0, first[0] + g * h * v0, v0, factors[0], q, qdot)
    _advance(bristles, 1, first[1] + g * h * v1, v1, factors[1], q, qdot)
    _advance(bristles, 2, first[2] + g * h * v2, v2, factors[2], q, qdot)


@allocation_free
def _advance(
    bristles: BristleFriction, hinge: int, travel: float, rate: float, factor: float, q: Array, qdot: Array
) -> None:
    """Write the state of a hinge and of its elements at the end of the step."""
    bristles.torque_q[0, hinge] = bristles.torque_q[1, hinge] = 0.0
    for element in range(ELEMENTS):
        torque, _, deflection = _element(bristles, element, hinge, travel, factor)
        bristles.torque_q[element // CABLE, hinge] += torque
        bristles.deflection_rad[element, hinge] = deflection
    bristles.stribeck_factor[hinge] = factor
    q[hinge], qdot[hinge] = bristles.start_q[hinge] + travel, rate


@allocation_free
def _stribeck_factor(bristles: BristleFriction, hinge: int, rate: float) -> float:
    """Return the factor of the slip deflections of a bearing at the end of the step; 1 unless it slips."""
    deflection = bristles.deflection_rad[LAST, hinge]
    slip = bristles.slip_rad[LAST] * bristles.stribeck_factor[hinge]
    if abs(deflection) < _SLIPS * slip or deflection * rate <= 0.0:
        return 1.0
    share, ratio = bristles.coulomb_share, rate / bristles.stribeck_rad_s
    return share + (1.0 - share) * exp(-ratio * ratio)


@allocation_free
def _hinge_torque(
    bristles: BristleFriction, hinge: int, travel: float, factor: float, secant: bool
) -> tuple[float, float]:
    """Return the mean torque against a rotation, N·m, and its slope or secant, N·m/rad."""
    torque, slope = 0.0, 0.0
    for element in range(ELEMENTS):
        own, own_slope, _ = _element(bristles, element, hinge, travel, factor)
        if secant and travel != 0.0:
            at_rest, _, _ = _element(bristles, element, hinge, 0.0, factor)
            own_slope = max((own - at_rest) / travel, 0.0)
        torque, slope = torque + own, slope + own_slope
    return torque, slope


@allocation_free
def _element(
    bristles: BristleFriction, element: int, hinge: int, travel: float, factor: float
) -> tuple[float, float, float]:
    """Return mean torque and slope of an element for a rotation, and its deflection after that."""
    g, stiffness = bristles.implicitness, bristles.stiffness_Nm_rad[element, hinge]
    if stiffness == 0.0:
        return 0.0, 0.0, 0.0
    damping = bristles.damping_Nm_s[element, hinge] / bristles.step_s
    slip = last_slip = bristles.slip_rad[element]
    if element < CABLE:
        slip, last_slip = factor * slip, bristles.stribeck_factor[hinge] * slip
    sign = 1.0 if travel >= 0.0 else -1.0
    start, length = max(sign * bristles.deflection_rad[element, hinge], -slip), abs(travel)
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
        share = free / length
        torque = stiffness * (slip - (1.0 - g) * free * share) + damping * free
        slope, end = stiffness * (1.0 - g) * share * share, slip
    if torque > stiffness * slip:
        torque, slope = stiffness * slip, 0.0
    return sign * torque, slope, sign * end
