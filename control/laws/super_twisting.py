"""Super-twisting: a second-order sliding mode with continuous torque.

``tau = M(q) (qddot_d - lambda edot - k1 phi1(s)) + C(q, qdot) qdot + W``, ``W' = -J k2 phi2(s)`` with
``s = lambda e + edot``, the nominal M and C, and

    φ₁ = |s|^½ sgn s + μ s,   φ₂ = φ₁ φ₁' = ½ sgn s + (3/2) μ |s|^½ sgn s + μ² s.

μ = 0 is the law of Bartolini and others, International Journal of Control 89 (2016), doi
10.1080/00207179.2016.1142616, without its adaptation; the linear terms help if s is large.

*Stability.* On an axis M and J cancel: ṡ = −k₁φ₁ + w, w' = −k₂φ₂, where a constant load is part of w. In
ζ = (φ₁, w/√k₂) that is ζ' = φ₁'(s) A ζ with A = [−k₁ √k₂; −√k₂ 0], which is stable for all positive gains.
With AᵀP + PA = −1 and V = ζᵀPζ, V' = −(½|s|^(−½) + μ)|ζ|² ≤ −a √V − b V, where a = ½ √p_min/p_max and
b = μ/p_max for the eigenvalues p of P: s and ṡ are 0 after at most (2/b) ln(1 + (b/a) √V₀), or 2 √V₀/a where
μ = 0. In sampled form |s| stays at about (k₁T/2)², where the root reverses s within one period. W is
back-calculated, as in `control.law_components.feedback`, at λ/√3.

*Tuning by two parameters.* Far from the surface the polynomial of an axis is (p + λ)(p² + k₁μ p + k₂μ²): with
λ = ω, k₁ = 2ω/μ and k₂ = ω²/μ² three poles at −ω. A smaller μ gives the root more weight and more
ripple in the currents.

*Default.* ω = 40 1/s, μ = 8, chosen for the tilt (60) with the prototype's hardware; on ideal hardware a
faster one is better. `spheretwin reproduce rivals` reports the figures; the study `tuning` searches ω and μ.
"""

from math import sqrt
from typing import Literal

import numpy as np
from pydantic import Field

from spheretwin.control.law import Law, NominalModel, NonNegativeEach, PositiveEach, each
from spheretwin.control.law_components.extended_state_observer import (
    delayed_command,
    history_layout,
    store_command,
)
from spheretwin.control.law_components.feedback import SLIDING_SIGNAL, sliding_surface, tracking_rate
from spheretwin.control.law_components.nominal_motion import model_torque
from spheretwin.control.law_components.parameters import LawParameters, named
from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry.signals import ANGLES, Signal

SIGNALS = (
    SLIDING_SIGNAL,
    Signal("twisting_torque_Nm", "N·m", 3, "torque W of the integral", ANGLES),
)
SURFACE_SLOPE, ROOT, TWISTING, LINEAR, TRACKING, INERTIA, FRACTION, PERIOD = 0, 3, 6, 9, 12, 15, 18, 19
SLIDING, TWISTED, HISTORY = 0, 3, 6  # layout of the state

BANDWIDTH_rad_s = 40.0
LINEAR_SHARE = 8.0  # (rad/s)^-½


class SuperTwisting(LawParameters):
    """Super-twisting."""

    law: Literal["super_twisting"] = named("super_twisting")
    surface_slope: PositiveEach = Field(each(BANDWIDTH_rad_s), description="λ of s = λe + ė, 1/s")
    root_gain: PositiveEach = Field(
        each(2 * BANDWIDTH_rad_s / LINEAR_SHARE), description="k₁ of the proportional part, (rad/s³)^½"
    )
    twisting_gain: PositiveEach = Field(
        each((BANDWIDTH_rad_s / LINEAR_SHARE) ** 2), description="k₂ of the integral, rad/s³"
    )
    linear_share: NonNegativeEach = Field(
        each(LINEAR_SHARE),
        description="μ, weight of s relative to its root, (rad/s)^-½; 0 for the root alone",
    )

    def build(self, known: NominalModel) -> Law:
        """Return a law whose integral starts at 0."""
        fraction, size = history_layout(known)
        tracking = tracking_rate(np.array(self.surface_slope) / sqrt(3), known)
        gains = [*self.surface_slope, *self.root_gain, *self.twisting_gain, *self.linear_share]
        parameters = np.array([*gains, *tracking, *known.inertia, fraction, known.period_s])
        return Law(self.law, step, parameters, np.zeros(HISTORY + size), SIGNALS, asks_torque=True)


def step(
    t: float, reference: Array, measurement: Array, parameters: Array, state: Array, torque: Array
) -> None:
    """Write the torque of one control tick; see `control.law.Law`."""
    period, history, inertia = parameters[PERIOD], state[HISTORY:], parameters[INERTIA : INERTIA + 3]
    acceleration, growth = np.empty(3), np.empty(3)
    for axis in range(3):
        slope, linear = parameters[SURFACE_SLOPE + axis], parameters[LINEAR + axis]
        error_rate = measurement[1, axis] - reference[1, axis]
        s = sliding_surface(measurement[0, axis] - reference[0, axis], error_rate, slope)
        root, sign = sqrt(abs(s)), np.sign(s)
        first = (root + linear * root * root) * sign
        second = (0.5 + 1.5 * linear * root + linear * linear * root * root) * sign
        acceleration[axis] = reference[2, axis] - slope * error_rate - parameters[ROOT + axis] * first
        growth[axis] = -parameters[TWISTING + axis] * inertia[axis] * second
        torque_error = measurement[2, axis] - delayed_command(history, axis, parameters[FRACTION])
        state[TWISTED + axis] += period * parameters[TRACKING + axis] * torque_error
        state[SLIDING + axis] = s
    model_torque(measurement, acceleration, measurement[1], inertia, torque)
    for axis in range(3):
        torque[axis] += state[TWISTED + axis]
        state[TWISTED + axis] += period * growth[axis]
    store_command(history, torque)
