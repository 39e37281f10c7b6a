"""Linear quadratic regulator with integral (LQI): PID feedback with the gains of least cost.

The regulator follows Anderson and Moore, *Optimal Control: Linear Quadratic Methods* (1990).

An axis is a double integrator, and the integral of the error is a third state. Of all feedbacks of
(e, ė, ∫e) the regulator minimises Σ ((w_e e)² + (w_r ė)² + (w_i ∫e)² + v²) over the ticks, with v the
acceleration, constant over each tick. The discrete Riccati equation is solved when the law is built. The
weights are in the units of the gains. Integral and windup are those of `control.law_components.feedback`.

*Tuning.* For fast ticks the identity of the return difference gives integral = w_i,
stiffness² = w_e² + 2 integral damping and damping² = w_r² + 2 stiffness. The integral weight alone, ω³,
places Butterworth poles of radius ω; w_e as a share of ω² increases their damping; w_e = √3ω², w_r = √3ω,
w_i = ω³ give the triple pole of PID.

*Default.* ω = 60 1/s, no other weight, chosen for the tilt (60) with the prototype's hardware; on ideal
hardware a faster one is better. `spheretwin reproduce rivals` reports the figures; the study `tuning`
searches ω and w_e.
"""

from functools import lru_cache
from typing import Literal

import numpy as np
from pydantic import Field

from spheretwin.control.law import Law, NominalModel, NonNegativeEach, PositiveEach, each
from spheretwin.control.law_components.feedback import feedback
from spheretwin.control.law_components.parameters import LawParameters, named
from spheretwin.models.base.errors import InputError

BANDWIDTH_rad_s = 60.0

# Radians per period: faster poles are at 0, and the Riccati equation becomes ill-conditioned.
FASTEST = 10.0


@lru_cache(maxsize=64)
def regulator(
    error_weight: float, rate_weight: float, integral_weight: float, period_s: float
) -> tuple[float, float, float]:
    """Return stiffness (1/s²), damping (1/s) and integral (1/s³) of least cost.

    Parameters
    ----------
    error_weight, rate_weight, integral_weight : float, 1/s², 1/s and 1/s³
        Relative to the weight of the acceleration, which is 1.
    period_s : float, s
        Control period.

    Raises
    ------
    InputError
        The weights are too large for the control period, or too far apart for the equation to be solved.
    """
    from scipy.linalg import solve_discrete_are  # slow to import, used by this law only

    # In units of time in which the weights are about 1, the equation is best conditioned.
    scale = max(error_weight**0.5, rate_weight, integral_weight ** (1 / 3))
    h = scale * period_s
    weighed = f"received {error_weight:g}, {rate_weight:g} and {integral_weight:g}"
    if h > FASTEST:
        raise InputError(f"law lqi: expected weights for ticks of {period_s:g} s, {weighed}")
    A = np.array([[1.0, h, 0.0], [0.0, 1.0, 0.0], [h, 0.0, 1.0]])
    B = np.array([[0.5 * h * h], [h], [0.0]])
    weights = np.array([error_weight / scale**2, rate_weight / scale, integral_weight / scale**3])
    try:
        P = solve_discrete_are(A, B, h * np.diag(weights**2), h * np.eye(1))
    except (np.linalg.LinAlgError, ValueError):
        raise InputError(f"law lqi: expected weights nearer to each other, {weighed}") from None
    gains = np.linalg.solve(h + B.T @ P @ B, B.T @ P @ A)[0]
    return gains[0] * scale**2, gains[1] * scale, gains[2] * scale**3


class LQI(LawParameters):
    """Linear quadratic regulator with integral."""

    law: Literal["lqi"] = named("lqi")
    error_weight: NonNegativeEach = Field(each(0.0), description="weight of the error, 1/s²")
    rate_weight: NonNegativeEach = Field(each(0.0), description="weight of its rate, 1/s")
    integral_weight: PositiveEach = Field(
        each(BANDWIDTH_rad_s**3), description="weight of its integral, 1/s³"
    )

    def build(self, known: NominalModel) -> Law:
        """Return a law whose integral starts at 0."""
        weights = zip(self.error_weight, self.rate_weight, self.integral_weight, strict=True)
        gains = np.array([regulator(*axis_weights, known.period_s) for axis_weights in weights])
        return feedback(self.law, gains.T, known)
