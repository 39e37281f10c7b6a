"""Coulomb and viscous friction of the three hinges, for either plant.

On hinge i friction opposes the rate v with ``(viscous + coulomb / sqrt(v**2 + smoothing**2)) v``. Coulomb's
jump at rest is thus smoothed over a stated rate: the term is odd and grows with v up to the Coulomb level,
of which it has 71 % at the smoothing rate and 99.5 % at ten times that. A hyperbolic tangent would come
closer to the level, but as a factor k(v) of the rate it is 0/0 at rest; the root is not, and needs no
exponential. What holds the rotor at rest is k(0) = viscous + coulomb / smoothing, a stiff damping: taken at
the rates before a step, its torque would turn the rotor back as soon as the step times k passes the inertia,
and never let it rest. It is taken at the rates after the step instead (`friction_torque`): stable at any.
"""

from math import isfinite, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.base.errors import InputError
from spheretwin.models.lagrangian import InertiaEntries, inertia_entries, solve_inertia, triple, turns

# Far below any motion; its square is far above the smallest number, so that k(0) is one too.
SLOWEST_SMOOTHING_rad_s = 1e-12


class Friction(NamedTuple):
    """Friction of a run as compiled code sees it."""

    coulomb_Nm: NDArray[np.float64]  # (3,)
    viscous_Nm_s: NDArray[np.float64]  # (3,)
    smoothing_rate_rad_s: float
    inertia: NDArray[np.float64]  # (3,) kg·m² about the joint centre, modelling error and payload included
    step_s: float
    acts: bool  # whether there is any; if not, no step needs to ask for it


def friction(
    coulomb_Nm: NDArray[np.float64],
    viscous_Nm_s: NDArray[np.float64],
    smoothing_rate_rad_s: float,
    inertia: NDArray[np.float64],
    step_s: float,
) -> Friction:
    """Friction on the hinges (alpha, beta, gamma) of a rotor.

    Parameters
    ----------
    coulomb_Nm : (3,) array, N·m
        Level that friction reaches well above the smoothing rate.
    viscous_Nm_s : (3,) array, N·m·s
        Friction a unit of rate.
    smoothing_rate_rad_s : float, rad/s
        Rate over which the Coulomb term changes sign.
    inertia : (3,) array, kg·m²
        Principal inertias about the joint centre, modelling error and payload included.
    step_s : float, s
        Physics step, over which the torque is held.

    Raises
    ------
    InputError
        A coefficient that is negative or not finite, or a smoothing rate that is too small or not finite.
    """
    coulomb, viscous = _coefficients("coulomb_Nm", coulomb_Nm), _coefficients("viscous_Nm_s", viscous_Nm_s)
    if not (isfinite(smoothing_rate_rad_s) and smoothing_rate_rad_s >= SLOWEST_SMOOTHING_rad_s):
        raise InputError(
            f"friction: expected a finite smoothing_rate_rad_s of at least {SLOWEST_SMOOTHING_rad_s:g},"
            f" received {smoothing_rate_rad_s:g}"
        )
    acts = bool(np.any(coulomb) or np.any(viscous))
    moments = np.array(inertia, dtype=np.float64)
    return Friction(coulomb, viscous, float(smoothing_rate_rad_s), moments, float(step_s), acts)


@allocation_free
def friction_torque(
    friction: Friction,
    q: NDArray[np.float64],
    qdot: NDArray[np.float64],
    torque_q: NDArray[np.float64],
) -> None:
    """Friction's generalised torque, to be held over one physics step beside all other torques.

    Parameters
    ----------
    friction : Friction
        Coefficients, inertia and physics step.
    q : (3,) array, rad
        Pose at the start of the step, away from beta = +-90 degrees.
    qdot : (3,) array, rad/s
        Hinge rates at the start of the step.
    torque_q : (3,) array, N·m
        Result, on (alpha, beta, gamma).

    Notes
    -----
    With K = diag(k(qdot)), the inertia matrix M at `q` and the step h, the torque is ``-K v`` at the rates v
    that it leads to by itself, ``M (v - qdot) = -h K v``, so that ``(M + h K) v = M qdot``.

    It can neither amplify a motion nor reverse it, whatever the step and the coefficients. The scalar product
    of that equation with v gives ``v.M v + h v.K v = v.M qdot``. K has no negative entry, and the right side
    is at most ``|v| |qdot|`` in the norm of the kinetic energy (Cauchy and Schwarz), so ``|v| <= |qdot|``;
    the left side is not negative, so ``v.M qdot >= 0``. The power ``-v.K v`` is never positive. No bound on h
    or on the condition of M enters: it need only be positive definite, which it is where the joint turns.

    A rotor that is pushed by less than the Coulomb level creeps: by a torque T alone on one hinge, without
    viscous friction, at ``smoothing T / sqrt(coulomb**2 - T**2)`` in the limit of a small step. As v leaves
    the other torques out, a step h ends at the rate v1 with ``k(v1) (v1 - h T / inertia) = T``, faster by
    a share of about ``h k(0) / inertia``.
    """
    h = friction.step_s
    M = inertia_entries(turns(triple(q)), triple(friction.inertia))
    momentum = (
        M.alpha * qdot[0] + M.alpha_beta * qdot[1] + M.alpha_gamma * qdot[2],
        M.alpha_beta * qdot[0] + M.beta * qdot[1],
        M.alpha_gamma * qdot[0] + M.gamma * qdot[2],
    )
    k = _factor(friction, qdot, 0), _factor(friction, qdot, 1), _factor(friction, qdot, 2)
    damped = InertiaEntries(
        alpha=M.alpha + h * k[0],
        beta=M.beta + h * k[1],
        gamma=M.gamma + h * k[2],
        alpha_beta=M.alpha_beta,
        alpha_gamma=M.alpha_gamma,
    )
    v = solve_inertia(damped, momentum)
    for i in range(3):
        torque_q[i] = -k[i] * v[i]


@allocation_free
def _factor(friction: Friction, qdot: NDArray[np.float64], hinge: int) -> float:
    """Friction of a hinge over its rate, N·m·s."""
    rate, smoothing = qdot[hinge], friction.smoothing_rate_rad_s
    return friction.viscous_Nm_s[hinge] + friction.coulomb_Nm[hinge] / sqrt(rate**2 + smoothing**2)


def _coefficients(name: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
    coefficients = np.array(values, dtype=np.float64)
    if coefficients.shape != (3,) or not np.all(np.isfinite(coefficients) & (coefficients >= 0)):
        raise InputError(
            f"friction: expected {name} of three finite values that are not negative, received {values}"
        )
    return coefficients
