"""Adaptive backstepping sliding mode: a surface designed in two steps, and a disturbance estimate.

After Liu and others, *Aerospace Science and Technology* 67 (2017), doi 10.1016/j.ast.2017.03.032. The
first step sets ė to −c e, the second defines the surface σ = k e + (ė + c e) on the remainder. Only the sum
of c and k enters the law, so λ = c + k is the parameter: σ = ė + λe, and with the rate q̇_r = q̇_d − λe

    τ = M q̈_r + C q̇_r − J h (σ + β sat(σ/δ)) + D,   D' = −J γ σ.

*Stability.* With the true model and a constant load d, M σ̇ + C σ = −J h (σ + β sat) + D − d, and Ṁ − 2C is
skew-symmetric. So for 0 < w < 4λh

    V  = ½ σᵀMσ + ½ w Σ J e² + ½ Σ (D − d)²/(Jγ)
    V' = −Σ J (h σ² − w e σ + wλ e²) − h β Σ J |σ sat(σ/δ)| ≤ 0,

on the coupled rotor, not on three separate axes; e and σ go to 0 by Barbalat's lemma, under any constant
load. The sign function of the paper is smoothed over the layer δ; |D| is limited by back-calculation, as in
`control.law_components.feedback`, at the rate √(λγ/(λ + h)) of the integral and damping of the law near
rest.

*Tuning by one parameter.* Within the layer the characteristic polynomial of an axis at rest is
(s + λ)(s² + h(1 + β/δ) s + γ): with λ = ω, h(1 + β/δ) = 2ω and γ = ω² three poles at −ω. β/δ = ½ leaves
h = 4ω/3 outside.

*Default.* ω = 40 1/s, β = 0.05 rad/s, δ = 0.1 rad/s, chosen for the tilt (60) with the prototype's hardware;
on ideal hardware a faster one is better. `spheretwin reproduce rivals` reports the figures; the study
`tuning` searches ω and the layer.
"""

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
    Signal("adapted_torque_Nm", "N·m", 3, "estimate D of the disturbance", ANGLES),
)
# Layout of the parameters.
SURFACE_SLOPE, REACHING_GAIN, SWITCHING, LAYER, ADAPTATION, TRACKING, INERTIA, FRACTION, PERIOD = (
    0, 3, 6, 9, 12, 15, 18, 21, 22,
)  # fmt: skip
SLIDING, ADAPTED, HISTORY = 0, 3, 6  # layout of the state

BANDWIDTH_rad_s = 40.0


class BacksteppingSlidingMode(LawParameters):
    """Adaptive backstepping sliding mode."""

    law: Literal["backstepping_sliding_mode"] = named("backstepping_sliding_mode")
    surface_slope: PositiveEach = Field(each(BANDWIDTH_rad_s), description="λ = c + k of σ = λe + ė, 1/s")
    reaching_gain: PositiveEach = Field(
        each(4 * BANDWIDTH_rad_s / 3), description="h of the reaching term, 1/s"
    )
    switching: NonNegativeEach = Field(
        each(0.05), description="β, switching part of the reaching term, rad/s"
    )
    layer: PositiveEach = Field(each(0.1), description="δ, boundary layer of the switching, rad/s")
    adaptation_rate: NonNegativeEach = Field(
        each(BANDWIDTH_rad_s**2), description="γ, adaptation rate of the disturbance's estimate, 1/s²"
    )

    def build(self, known: NominalModel) -> Law:
        """Return a law whose estimate starts at 0."""
        fraction, size = history_layout(known)
        slope, reaching = np.array(self.surface_slope), np.array(self.reaching_gain)
        tracking = tracking_rate(np.sqrt(slope * self.adaptation_rate / (slope + reaching)), known)
        gains = [*self.surface_slope, *self.reaching_gain, *self.switching, *self.layer]
        rates = [*self.adaptation_rate, *tracking]
        parameters = np.array([*gains, *rates, *known.inertia, fraction, known.period_s])
        return Law(self.law, step, parameters, np.zeros(HISTORY + size), SIGNALS, asks_torque=True)


def step(
    t: float, reference: Array, measurement: Array, parameters: Array, state: Array, torque: Array
) -> None:
    """Write the torque of one control tick; see `control.law.Law`."""
    period, history, inertia = parameters[PERIOD], state[HISTORY:], parameters[INERTIA : INERTIA + 3]
    rate, acceleration = np.empty(3), np.empty(3)
    for axis in range(3):
        slope = parameters[SURFACE_SLOPE + axis]
        error = measurement[0, axis] - reference[0, axis]
        error_rate = measurement[1, axis] - reference[1, axis]
        state[SLIDING + axis] = sliding_surface(error, error_rate, slope)
        rate[axis] = reference[1, axis] - slope * error
        acceleration[axis] = reference[2, axis] - slope * error_rate
        torque_error = measurement[2, axis] - delayed_command(history, axis, parameters[FRACTION])
        state[ADAPTED + axis] += period * parameters[TRACKING + axis] * torque_error
    model_torque(measurement, acceleration, rate, inertia, torque)
    for axis in range(3):
        s = state[SLIDING + axis]
        switched = parameters[SWITCHING + axis] * min(1.0, max(-1.0, s / parameters[LAYER + axis]))
        reaching = parameters[REACHING_GAIN + axis] * (s + switched)
        torque[axis] += state[ADAPTED + axis] - inertia[axis] * reaching
        state[ADAPTED + axis] -= period * parameters[ADAPTATION + axis] * inertia[axis] * s
    store_command(history, torque)
