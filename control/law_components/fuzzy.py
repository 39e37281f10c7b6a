"""First-order Takagi-Sugeno approximator of one axis: 25 rules, 75 adapted consequents (32)-(34), (57).

The input is ``x = (x1, x2)``, rate and angle of the axis. Five Gaussian sets each cover an input; a rule is
one set of the rate and one of the angle; its consequent is ``theta_0 + theta_1 x1 + theta_2 x2``.
"""

from math import exp, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import allocation_free, inlined
from spheretwin.models.base.vectors import Vector, like, store, total, vector

CENTRES = (-3.0, -1.5, 0.0, 1.5, 3.0)
WIDTH = 1.0  # sigma of (57)
SHAPE = 0.5  # b of (57)
SETS = len(CENTRES)
RULES = SETS * SETS
CONSEQUENTS = 3 * RULES


# Relative to that of the middle set, the degrees are ``_FAR / r**2``, ``_NEAR / r``, 1, ``_NEAR r`` and
# ``_FAR r**2``, with ``r = exp(_SLOPE x)``.
_SPACING = CENTRES[1] - CENTRES[0]
_SLOPE = SHAPE * _SPACING / (2.0 * WIDTH**2)
_NEAR, _FAR = (exp(-SHAPE * (places * _SPACING / (2.0 * WIDTH)) ** 2) for places in (1, 2))

# There the degree of an outer set differs from 1 by less than a rounding error.
_SATURATION = 100.0


@allocation_free
def memberships(x: float) -> tuple[float, float, float, float, float]:
    """Return the degrees of membership of `x` in the five sets, normalised to sum 1 (57).

    The centres are equally spaced: one exponential gives all degrees relative to that of the middle set.
    """
    rise = exp(_SLOPE * min(max(x, -_SATURATION), _SATURATION))
    fall = 1.0 / rise
    a, b, d, e = _FAR * fall * fall, _NEAR * fall, _NEAR * rise, _FAR * rise * rise
    share = 1.0 / (a + b + 1.0 + d + e)
    return a * share, b * share, share, d * share, e * share


@allocation_free
def approximate_and_adapt(rate: float, angle: float, drive: float, consequents: NDArray[np.float64]) -> float:
    """Compute the output ``theta^T Psi`` (33), then one Euler step ``theta += drive Psi`` of (43).

    Parameters
    ----------
    rate, angle : float, rad/s and rad
        Input of the axis.
    drive : float
        ``-eta s`` times the control period.
    consequents : (75,) array
        theta, changed in place: 25 constants, 25 factors of the rate, 25 factors of the angle.

    Returns
    -------
    float
        Output of the approximator before the adaptation.
    """
    of_rate, (a, b, c, d, last) = memberships(rate), memberships(angle)
    of_first, of_last = vector(0.0, 0.0, 0.0, 0.0), 0.0
    for i in range(SETS):
        first_four = of_rate[i] * vector(a, b, c, d)
        of_first = of_first + _apply_and_adapt(first_four, SETS * i, rate, angle, drive, consequents)
        of_last += _apply_and_adapt(of_rate[i] * last, SETS * i + 4, rate, angle, drive, consequents)
    return total(of_first) + of_last


@inlined
def _apply_and_adapt(
    psi: Vector, k: int, rate: float, angle: float, drive: float, theta: NDArray[np.float64]
) -> Vector:
    """Return the contribution of rule k, or of four rules from it on, before the adaptation."""
    constant, of_rate = like(psi, theta, k), like(psi, theta, RULES + k)
    of_angle, step = like(psi, theta, 2 * RULES + k), drive * psi
    store(constant + step, theta, k)
    store(of_rate + step * rate, theta, RULES + k)
    store(of_angle + step * angle, theta, 2 * RULES + k)
    return psi * (constant + of_rate * rate + of_angle * angle)


class AdaptationLimits(NamedTuple):
    """Limits of the adaptation that prevent drift of the consequents."""

    dead_zone: float  # of |s|, rad/s
    leakage: float  # 1/s
    bound: float  # of the norm of theta


@allocation_free
def approximate_within_bounds(
    rate: float,
    angle: float,
    s: float,
    adaptation_rate: float,
    limits: AdaptationLimits,
    period_s: float,
    consequents: NDArray[np.float64],
) -> float:
    """Compute the output ``theta^T Psi``, then one Euler step of the limited adaptation.

    Parameters
    ----------
    rate, angle : float, rad/s and rad
        Input of the axis.
    s : float, rad/s
        Sliding variable.
    adaptation_rate : float
        eta; with 0 nothing is learnt, and the consequents leak away.
    limits : AdaptationLimits
    period_s : float, s
    consequents : (75,) array
        theta, changed in place.
    """
    s_effective = s if abs(s) > limits.dead_zone else 0.0
    drive = -adaptation_rate * s_effective * period_s
    output = approximate_and_adapt(rate, angle, drive, consequents)
    squares = 0.0
    for k in range(consequents.shape[0]):
        squares += consequents[k] * consequents[k]
    factor = max(0.0, 1.0 - limits.leakage * period_s)
    norm = factor * sqrt(squares)
    if norm > limits.bound:
        factor *= limits.bound / norm
    for k in range(consequents.shape[0]):
        consequents[k] *= factor
    return output
