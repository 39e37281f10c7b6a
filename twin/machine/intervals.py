"""95 % intervals: from the curvature of the cost, or from its profile where it is not quadratic."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from spheretwin.models.base.arrays import Array

Z95 = 1.959963984540054
"""Standard deviations on each side of a 95 % interval."""

# Of the rise of the cost at the end of an interval: beyond it the cost is not quadratic enough.
_DIFFERENT = 0.2

# An end is sought up to this many times as far as the curvature says.
_FARTHEST = 4.0


class Uncertainty(NamedTuple):
    """Uncertainty of identified parameters about the machine that has them."""

    names: tuple[str, ...]
    covariance: Array
    """(p, p)."""

    @classmethod
    def of(cls, values: Mapping[str, float], covariance: Array) -> Uncertainty:
        """Return the uncertainty of values by name; the fields of the machine already contain its scale."""
        scale = np.array([value if name == "torque_scale" else 1.0 for name, value in values.items()])
        return cls(tuple(values), covariance / np.outer(scale, scale))


class LeastSquaresCost(NamedTuple):
    """Cost of a least-squares problem, half the sum of squares, about its best values."""

    at: Callable[[Array], float]
    normal: Callable[[Array], tuple[Array, Array]]
    """Information and gradient at some values."""
    best: Array
    lowest: float
    """Cost of the best values."""
    least: Array
    """Lower bounds."""
    most: Array
    """Upper bounds."""


def interval(
    cost: LeastSquaresCost, covariance: Array, place: int, wider: float = 1.0
) -> tuple[float, float]:
    """Return the 95 % interval of one parameter.

    Parameters
    ----------
    cost : LeastSquaresCost
    covariance : (p, p) array
        Inverse of the information at the best values.
    place : int
        Number of the parameter.
    wider : float
        Width over that which noise alone gives.
    """
    half = Z95 * wider
    low, high = (_end(cost, covariance, place, half, sign) for sign in (-1.0, 1.0))
    return float(max(low, cost.least[place])), float(min(high, cost.most[place]))


def _end(cost: LeastSquaresCost, covariance: Array, place: int, half: float, sign: float) -> float:
    """Return one end: where the cost, minimised over the other parameters, has risen by half of half²."""
    deviation = np.sqrt(covariance[place, place])
    # Along it the other parameters stay at their best, as far as the cost is quadratic.
    direction = sign * covariance[:, place] / deviation
    end = cost.best + half * direction
    if np.any((end < cost.least) | (end > cost.most)):
        return float(end[place])
    rise = 0.5 * half**2
    if abs(cost.at(end) - cost.lowest - rise) <= _DIFFERENT * rise:
        return float(end[place])

    def excess(distance: float) -> float:
        values = np.clip(cost.best + distance * direction, cost.least, cost.most)
        information, gradient = cost.normal(values)
        others = np.arange(len(values)) != place
        step = np.linalg.solve(information[np.ix_(others, others)], gradient[others])
        return float(cost.at(values) - 0.5 * gradient[others] @ step - cost.lowest - rise)

    from scipy.optimize import brentq  # slow to import, and a run needs no interval

    try:
        distance = brentq(excess, 0.1, _FARTHEST * half, xtol=0.02, maxiter=12)
    except (ValueError, RuntimeError):  # no end there: the curvature is all that is known
        distance = half
    return float(cost.best[place] + distance * direction[place])
