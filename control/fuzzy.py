"""First-order Takagi-Sugeno approximator of one axis: 25 rules, 75 adapted consequents (32)-(34), (57).

The input is ``x = (x1, x2)``, rate and angle of the axis. Five Gaussian sets each cover an input; a rule is
one set of the rate and one of the angle; its consequent is ``theta_0 + theta_1 x1 + theta_2 x2``.
"""

from math import exp

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.compiled import compiled

CENTRES = (-3.0, -1.5, 0.0, 1.5, 3.0)
WIDTH = 1.0  # sigma of (57)
SHAPE = 0.5  # b of (57)
SETS = len(CENTRES)
RULES = SETS * SETS
CONSEQUENTS = 3 * RULES


@compiled
def memberships(x: float, degree: NDArray[np.float64]) -> None:
    """Degrees of membership of `x` in the five sets, normalised to sum 1, written into `degree` (5,).

    The nearest set's exponent is taken off before the exponential (which divides numerator and
    denominator alike), so at least one degree is 1 before normalising: nothing underflows at any x.
    """
    exponent = -SHAPE / (4.0 * WIDTH**2)
    nearest = exponent * (x - CENTRES[0]) ** 2
    for k in range(1, SETS):
        nearest = max(nearest, exponent * (x - CENTRES[k]) ** 2)
    total = 0.0
    for k in range(SETS):
        degree[k] = exp(exponent * (x - CENTRES[k]) ** 2 - nearest)
        total += degree[k]
    for k in range(SETS):
        degree[k] /= total


@compiled
def basis(rate: float, angle: float) -> NDArray[np.float64]:
    """Normalised firing strengths psi of the 25 rules (34).

    Because the product of two normalised sets of degrees sums to 1, the inputs are normalised apart.

    Parameters
    ----------
    rate : float, rad/s
    angle : float, rad

    Returns
    -------
    (25,) array
        Non-negative, with sum 1; rule ``5 i + j`` joins set i of the rate and set j of the angle.
    """
    of_rate, of_angle = np.empty(SETS), np.empty(SETS)
    memberships(rate, of_rate)
    memberships(angle, of_angle)
    psi = np.empty(RULES)
    for i in range(SETS):
        for j in range(SETS):
            psi[SETS * i + j] = of_rate[i] * of_angle[j]
    return psi


@compiled
def approximate_and_adapt(rate: float, angle: float, drive: float, consequents: NDArray[np.float64]) -> float:
    """Output ``theta^T Psi`` (33), then one Euler step ``theta += drive Psi`` of its adaptation (43).

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
        The approximator's output before the adaptation.
    """
    psi = basis(rate, angle)
    output = 0.0
    for k in range(RULES):
        output += psi[k] * (
            consequents[k] + consequents[RULES + k] * rate + consequents[2 * RULES + k] * angle
        )
        consequents[k] += drive * psi[k]
        consequents[RULES + k] += drive * psi[k] * rate
        consequents[2 * RULES + k] += drive * psi[k] * angle
    return output
