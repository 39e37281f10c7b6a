"""Coulomb and viscous friction of the three hinges, for both engines.

On hinge i friction opposes the rate v with ``(viscous + coulomb / sqrt(v**2 + smoothing**2)) v``. Coulomb's
jump at rest is thus smoothed over a stated rate: the term is odd and grows with v up to the Coulomb level,
of which it has 71 % at the smoothing rate and 99.5 % at ten times that. A hyperbolic tangent comes
closer to the level, but as a factor k(v) of the rate it is 0/0 at rest; the root is defined at rest and needs
no exponential. The level may depend on the direction of
the motion. The damping k(0) = viscous + coulomb / smoothing keeps the rotor at rest. It is stiff: as an
explicit torque it would reverse the motion as soon as the step times k exceeds the inertia, and the rotor
would never rest. Instead `slow_down` advances the rates under friction alone, by half a physics step before
the step of the rotor and by half a step after it: this splitting is symmetric (Strang) and of second order.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free, inlined
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.record import Record, Rows, field, put
from spheretwin.models.joint_chain import JointChain, general_inertia
from spheretwin.models.kinematics import Triple, triple, turns
from spheretwin.models.lagrangian import InertiaEntries, inertia_entries, solve_inertia
from spheretwin.plant.plant_part import PlantPart, PlantSetup

Levels = tuple[Triple, Triple]
"""Coulomb friction of the hinges towards positive and towards negative angles, N·m."""

# Far below any motion; its square is far above the smallest number, so that k(0) is finite.
SLOWEST_SMOOTHING_rad_s = 1e-12

# Pole of 1 / (1 + x + x**2 / 2), where 1 + POLE x = 0; the other pole is its conjugate.
_POLE: Any = 0.5 + 0.5j
_RESIDUE: Any = 1.0 - 1.0j


class Friction(Record):
    """Friction of the hinges."""

    on: bool = field("whether there is friction")
    coulomb_Nm: Array = field("friction well above the smoothing rate, towards positive angles", "N·m", 3)
    reverse_Nm: Array = field("the same towards negative angles", "N·m", 3)
    viscous_Nm_s: Array = field("friction per unit of rate", "N·m·s", 3)
    smoothing_rate_rad_s: float = field("rate over which the Coulomb term changes sign", "rad/s")
    step_s: float = field("physics step, of which `slow_down` advances half", "s")


def fill_friction(
    frictions: Rows,
    coulomb_Nm: ArrayLike,
    viscous_Nm_s: ArrayLike,
    smoothing_rate_rad_s: ArrayLike,
    step_s: ArrayLike,
    asymmetry: ArrayLike = (0.0, 0.0, 0.0),
) -> None:
    """Fill the friction on the hinges (alpha, beta, gamma) of rotors.

    Parameters
    ----------
    frictions : array of Friction
    coulomb_Nm : (3,) or (n, 3) array, N·m
    viscous_Nm_s : (3,) or (n, 3) array, N·m·s
    smoothing_rate_rad_s : float or (n, 1) array, rad/s
    step_s : float or (n, 1) array, s
    asymmetry : (3,) or (n, 3) array
        -1 to 1: Coulomb friction is (1 + asymmetry) times its level towards positive angles, and (1 -
        asymmetry) times towards negative ones.

    Raises
    ------
    InputError
        A coefficient that is negative or not finite, or a smoothing rate that is too small or not finite.
    """
    for name, values in (("coulomb_Nm", coulomb_Nm), ("viscous_Nm_s", viscous_Nm_s)):
        _check_coefficients(name, np.atleast_2d(values))
    rates = np.ravel(smoothing_rate_rad_s)
    valid = np.isfinite(rates) & (rates >= SLOWEST_SMOOTHING_rad_s)
    if not valid.all():
        raise InputError(
            f"friction: expected a finite smoothing_rate_rad_s of at least {SLOWEST_SMOOTHING_rad_s:g},"
            f" received {rates[~valid][0]:g}"
        )
    forward_Nm, reverse_Nm = levels(np.asarray(coulomb_Nm), np.asarray(asymmetry))
    put(frictions, coulomb_Nm=forward_Nm, reverse_Nm=reverse_Nm, viscous_Nm_s=viscous_Nm_s)
    put(frictions, smoothing_rate_rad_s=smoothing_rate_rad_s, step_s=step_s)
    frictions["on"] = np.any(forward_Nm + reverse_Nm + frictions["viscous_Nm_s"], axis=1)


def levels(coulomb_Nm: Array, asymmetry: Array) -> tuple[Array, Array]:
    """Return the Coulomb levels towards positive and negative angles."""
    return coulomb_Nm * (1.0 + asymmetry), coulomb_Nm * (1.0 - asymmetry)


@inlined
def slow_down(friction: Friction, joint: JointChain, q: Array, qdot: Array, mean_torque_q: Array) -> None:
    """Advance the rates by half a physics step under friction alone, if there is any.

    Parameters
    ----------
    friction : Friction
    joint : JointChain
        Its inertia counts.
    q : (3,) array, rad
        Pose, away from beta = +-90 degrees; held.
    qdot : (3,) array, rad/s
        Hinge rates; changed in place.
    mean_torque_q : (3,) array, N·m
        Friction on (alpha, beta, gamma), mean over a complete physics step: this half is added.
    """
    if friction.on:
        viscous = triple(friction.viscous_Nm_s)
        coulomb = triple(friction.coulomb_Nm), triple(friction.reverse_Nm)
        smoothing, step_s = friction.smoothing_rate_rad_s, friction.step_s
        slow_hinges(joint, triple(joint.inertia), viscous, coulomb, smoothing, step_s, q, qdot, mean_torque_q)


@inlined
def slow_hinges(
    joint: JointChain,
    inertia: Triple,
    viscous: Triple,
    coulomb: Levels,
    smoothing: float,
    step_s: float,
    q: Array,
    qdot: Array,
    mean_torque_q: Array,
) -> None:
    """Advance the rates by half a physics step under friction alone.

    The parameters are those of `slow_down` as numbers; `inertia` is that of an ideal joint.

    Notes
    -----
    With the inertia matrix M at `q`, the time t = h/2 and K = diag(k), the rates v become ``R(X) v`` with
    ``X = t M**-1 K`` and ``R(x) = 1 / (1 + x + x**2 / 2)``, the stability function of Lobatto IIIC of two
    stages. k is taken at the rates in the middle, which one implicit Euler step over t/2 predicts with k at
    v: the error is of third order in t.

    It can neither amplify a motion nor reverse it, whatever the step and the coefficients. X is symmetric in
    the scalar product of the kinetic energy, ``u.M v``, and has no negative eigenvalue, as K has no negative
    entry. On such eigenvalues R is positive and at most 1. So ``|R(X) v| <= |v|`` in the norm of the kinetic
    energy, and ``v.M R(X) v >= 0``. For large x, R is ``2 / x**2``: the motion stops.

    R is the real part of ``(1 - i) / (1 + p x)`` with ``p = (1 + i) / 2``: one complex system
    ``(M + p t K) u = M v``, of the same zeros as M.
    """
    if joint.on:
        _slow_general(joint, viscous, coulomb, smoothing, step_s, q, qdot, mean_torque_q)
    else:
        M = inertia_entries(turns(triple(q)), inertia)
        _slow(M, False, viscous, coulomb, smoothing, step_s, qdot, mean_torque_q)


@allocation_free  # not inlined: a rotor with an ideal joint has it in no place
def _slow_general(
    joint: JointChain,
    viscous: Triple,
    coulomb: Levels,
    smoothing: float,
    step_s: float,
    q: Array,
    qdot: Array,
    mean_torque_q: Array,
) -> None:
    M = general_inertia(joint, triple(q))
    _slow(M, True, viscous, coulomb, smoothing, step_s, qdot, mean_torque_q)


@inlined
def _slow(
    M: InertiaEntries,
    general: bool,
    viscous: Triple,
    coulomb: Levels,
    smoothing: float,
    step_s: float,
    qdot: Array,
    mean_torque_q: Array,
) -> None:
    v = triple(qdot)
    qdot[0], qdot[1], qdot[2] = slowed(M, v, viscous, coulomb, smoothing, 0.5 * step_s, general)
    gained = momentum(M, (qdot[0] - v[0], qdot[1] - v[1], qdot[2] - v[2]), general)
    for i in range(3):
        mean_torque_q[i] += gained[i] / step_s


@inlined
def slowed(
    M: InertiaEntries,
    v: Triple,
    viscous: Triple,
    coulomb: Levels,
    smoothing: float,
    t: float,
    general: bool,
) -> Triple:
    """Return the rates (rad/s) after a time t (s) of friction alone, of a general or an ideal joint."""
    before = momentum(M, v, general)
    k = _factors(viscous, coulomb, smoothing, v)
    middle = solve_inertia(_damped(M, k, 0.5 * t), before, general)
    k = _factors(viscous, coulomb, smoothing, middle)
    if not general:
        return _slowed_ideal(M, (0.5 * t * k[0], 0.5 * t * k[1], 0.5 * t * k[2]), before)
    alpha, beta, gamma = solve_inertia(_damped(M, k, _POLE * t), before, general)
    return (_RESIDUE * alpha).real, (_RESIDUE * beta).real, (_RESIDUE * gamma).real


@inlined
def momentum(M: InertiaEntries, v: Triple, general: bool) -> Triple:
    """Return ``M v``, of a general or an ideal joint."""
    alpha = M.alpha * v[0] + M.alpha_beta * v[1] + M.alpha_gamma * v[2]
    beta, gamma = M.alpha_beta * v[0] + M.beta * v[1], M.alpha_gamma * v[0] + M.gamma * v[2]
    if not general:
        return alpha, beta, gamma
    return alpha, beta + M.beta_gamma * v[2], gamma + M.beta_gamma * v[1]


@inlined
def _factors(viscous: Triple, coulomb: Levels, smoothing: float, rates: Triple) -> Triple:
    """Return the friction of each hinge divided by its rate, N·m·s."""
    square, (forward, reverse) = smoothing**2, coulomb
    return (
        viscous[0] + (forward[0] if rates[0] > 0.0 else reverse[0]) / sqrt(rates[0] ** 2 + square),
        viscous[1] + (forward[1] if rates[1] > 0.0 else reverse[1]) / sqrt(rates[1] ** 2 + square),
        viscous[2] + (forward[2] if rates[2] > 0.0 else reverse[2]) / sqrt(rates[2] ** 2 + square),
    )


@inlined
def _damped(M: InertiaEntries, k: Triple, time: Any) -> InertiaEntries:
    """Return the inertia matrix plus a real or complex time times the friction factors."""
    return InertiaEntries(
        alpha=M.alpha + time * k[0],
        beta=M.beta + time * k[1],
        gamma=M.gamma + time * k[2],
        alpha_beta=M.alpha_beta,
        alpha_gamma=M.alpha_gamma,
        beta_gamma=M.beta_gamma,
    )


@inlined
def _slowed_ideal(M: InertiaEntries, damping: Triple, before: Triple) -> Triple:
    """Return the real part of ``(1 - i) u``, where ``(M + (1 + i) diag(damping)) u = before``.

    It is the elimination of `solve_inertia` for an ideal joint, with real and imaginary parts apart: complex
    divisions have branches, take longer, and are not vectorised.
    """
    a, b, c = damping
    # Reciprocals of the two diagonal entries that are eliminated.
    beta_re, beta_im = M.beta + b, b
    share = 1.0 / (beta_re * beta_re + beta_im * beta_im)
    beta_re, beta_im = share * beta_re, -share * beta_im
    gamma_re, gamma_im = M.gamma + c, c
    share = 1.0 / (gamma_re * gamma_re + gamma_im * gamma_im)
    gamma_re, gamma_im = share * gamma_re, -share * gamma_im
    left_re = M.alpha + a - beta_re * M.alpha_beta**2 - gamma_re * M.alpha_gamma**2
    left_im = a - beta_im * M.alpha_beta**2 - gamma_im * M.alpha_gamma**2
    share = 1.0 / (left_re * left_re + left_im * left_im)
    from_beta, from_gamma = M.alpha_beta * before[1], M.alpha_gamma * before[2]
    rest_re = before[0] - beta_re * from_beta - gamma_re * from_gamma
    rest_im = -beta_im * from_beta - gamma_im * from_gamma
    alpha_re = share * (rest_re * left_re + rest_im * left_im)
    alpha_im = share * (rest_im * left_re - rest_re * left_im)
    on_beta_re, on_beta_im = before[1] - M.alpha_beta * alpha_re, -M.alpha_beta * alpha_im
    on_gamma_re, on_gamma_im = before[2] - M.alpha_gamma * alpha_re, -M.alpha_gamma * alpha_im
    # The real part of (1 - i) u is the sum of both parts of u.
    beta = beta_re * (on_beta_re + on_beta_im) + beta_im * (on_beta_re - on_beta_im)
    gamma = gamma_re * (on_gamma_re + on_gamma_im) + gamma_im * (on_gamma_re - on_gamma_im)
    return alpha_re + alpha_im, beta, gamma


def _check_coefficients(name: str, rows: Array) -> None:
    for values in rows[~np.all(np.isfinite(rows) & (rows >= 0), axis=1)] if rows.shape[1] == 3 else rows:
        raise InputError(
            f"friction: expected {name} of three finite values that are not negative,"
            f" received {values.tolist()}"
        )


@inlined
def _slow_rotor(friction: Friction, plant: Any, substep: int) -> None:
    rotor = plant.rotor
    slow_down(friction, rotor.joint, rotor.q[:], rotor.qdot[:], plant.friction_q[:])


def _fill(rows: Rows, setup: PlantSetup) -> None:
    section = setup.scenario.plant
    coulomb_Nm = np.where(section.stiction.on, 0.0, section.coulomb_Nm)
    smoothing_rad_s, step_s = section.friction_smoothing_rad_s, section.step_s
    asymmetry = section.coulomb_asymmetry
    fill_friction(rows, coulomb_Nm, section.viscous_Nm_s, smoothing_rad_s, step_s, asymmetry)


FRICTION = PlantPart(Friction, _fill, before=_slow_rotor, after=_slow_rotor)
