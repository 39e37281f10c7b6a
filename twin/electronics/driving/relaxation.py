"""Exact integrals over a first-order relaxation, from a start towards a value that it would settle at.

With x = time over time constant and s running from 0 to x, what relaxes is ``a exp(-s) + b (1 - exp(-s))``.
Every integral of it, of its square and of its product with another one of the same time constant is a sum of
a and b with the five numbers of `Relaxation`. None of them is a small difference of large numbers, at any x:
a ramp (x near 0, b far away) keeps its digits as the approach to rest (x large) does.
"""

from math import expm1, factorial
from typing import NamedTuple

import numpy as np

from spheretwin.models.base.compiled import allocation_free

# Terms -(-x)**n / (n + 1)! and (-x)**n (2**n - 2) / (n + 1)!, without (-x)**n and with the sign of the first;
# up to x = 1/4, those left out are beyond the last digit.
_TERMS = 14
_MEAN = np.array([1 / factorial(n + 1) for n in range(_TERMS + 1)])
_SQUARE = np.array([(2**n - 2) / factorial(n + 1) for n in range(_TERMS + 1)])

# Up to here series have no more terms than need be; beyond, differences lose no more than their last digits.
SERIES_TO = 0.25


class Relaxation(NamedTuple):
    """Shares of start (a) and of where it settles (b), for a time x in time constants."""

    settled: float
    """``1 - exp(-x)``: share of the way done at the end."""
    mean: float
    """Mean of ``1 - exp(-s)``: share of the way done on average."""
    start_start: float
    """Mean of ``exp(-s)**2``."""
    start_settled: float
    """Mean of ``exp(-s) (1 - exp(-s))``."""
    settled_settled: float
    """Mean of ``(1 - exp(-s))**2``."""


@allocation_free
def relaxation(x: float) -> Relaxation:
    """Shares for a time of x time constants, x >= 0."""
    if x < SERIES_TO:
        mean, settled_settled = _series(x)
        remaining = 1.0 - mean  # on average
        settled = x * remaining
    else:
        settled = -expm1(-x)
        remaining = settled / x
        mean = (x - settled) / x
        settled_settled = (x - settled - 0.5 * settled * settled) / x
    return Relaxation(
        settled,
        mean,
        0.5 * remaining * (2.0 - settled),
        0.5 * remaining * settled,
        settled_settled,
    )


@allocation_free
def _series(x: float) -> tuple[float, float]:
    """``1 - (1 - exp(-x)) / x`` and the mean of ``(1 - exp(-s))**2``, for small x."""
    mean, settled_settled = 0.0, 0.0
    for n in range(_TERMS, 0, -1):
        mean = _MEAN[n] - x * mean
        settled_settled = _SQUARE[n] - x * settled_settled
    return x * mean, -x * settled_settled
