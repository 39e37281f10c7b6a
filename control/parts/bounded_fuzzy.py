"""The fuzzy approximator with an adaptation that cannot drift: dead zone, leakage, a bound.

As in (43) ``theta' = -eta s Psi``, but nothing is learnt from |s| within the dead zone, where s is noise;
what was learnt leaks away; and the norm of theta is held at its bound.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.parts.fuzzy import approximate_and_adapt
from spheretwin.models.base.compiled import allocation_free


class Restraint(NamedTuple):
    """What keeps the consequents from drifting."""

    dead_zone: float  # of |s|, rad/s
    leakage: float  # 1/s
    bound: float  # of the norm of theta


@allocation_free
def approximate_within_bounds(
    rate: float,
    angle: float,
    s: float,
    adaptation_rate: float,
    restraint: Restraint,
    period_s: float,
    consequents: NDArray[np.float64],
) -> float:
    """Output ``theta^T Psi``, then one Euler step of the restrained adaptation.

    Parameters
    ----------
    rate, angle : float, rad/s and rad
        Input of the axis.
    s : float, rad/s
        Sliding variable.
    adaptation_rate : float
        eta; 0 learns nothing, and what was learnt leaks away.
    restraint : Restraint
    period_s : float, s
    consequents : (75,) array
        theta, changed in place.
    """
    learnt_from = s if abs(s) > restraint.dead_zone else 0.0
    drive = -adaptation_rate * learnt_from * period_s
    output = approximate_and_adapt(rate, angle, drive, consequents)
    squares = 0.0
    for k in range(consequents.shape[0]):
        squares += consequents[k] * consequents[k]
    kept = max(0.0, 1.0 - restraint.leakage * period_s)
    norm = kept * sqrt(squares)
    if norm > restraint.bound:
        kept *= restraint.bound / norm
    for k in range(consequents.shape[0]):
        consequents[k] *= kept
    return output
