r"""Filtered difference: the backward difference of the angle through a first-order low-pass.

With the period T, the bandwidth ω and p = e^(−ωT),

    v_k = p v_(k−1) + (1 − p) (y_k − y_(k−1)) / T,      V/Y = (1 − p)/T · (1 − z⁻¹)/(1 − p z⁻¹).

This is the low-pass ω/(s + ω) solved exactly for an angle that is linear between samples: the difference is
its rate over that time.

*Noise gain.* The response to an impulse of the angle is (1 − p)/T at once and −p^(n−1) (1 − p)²/T at the n-th
tick after. White noise of variance σ² adds their squares:

    var v / σ² = (1 − p)²/T² · (1 + (1 − p)²/(1 − p²)) = 2 (1 − p)² / (T² (1 + p)).

It tends to ω² for ωT ≪ 1, hence to a deviation of σ ω for any sampling rate. Faster sampling does not help,
which is the disadvantage of this estimator; a filter of second order (`kalman`) uses every sample.

*Lag.* With y = ½ a t² the difference is a (t − T/2), half a period late. From v = a (t − lag) follows

    lag = T/2 + p T/(1 − p) = (T/2) coth(ωT/2),         near 1/ω.

A ramp of the angle is followed with an error that decreases by the factor p at each tick; a constant one
gives rate 0.

*Default.* ω = 150 1/s, 1.5 times what AFSM needs on the prototype. In slow motion a count c of an
encoder is a pulse of (1 − p) c/T, which decays in 1/ω.
"""

from typing import Literal

import numpy as np

from spheretwin.control.estimators.estimator import (
    BandwidthEach,
    Derived,
    Estimator,
    EstimatorParameters,
    Sampling,
    bandwidth_field,
    jumped,
    named,
    usable,
)
from spheretwin.models.base.arrays import Array

DECAY, GAIN = 0, 3  # layout of the parameters: p, and (1 - p) / T
STARTED, ANGLE, RATE = 0, 3, 6  # layout of the memory


class Difference(EstimatorParameters):
    """Filtered difference."""

    kind: Literal["difference"] = named("difference")
    bandwidth_rad_s: BandwidthEach = bandwidth_field(150.0)

    def build(self, sampling: Sampling) -> Estimator:
        """Return the estimator with the low-pass solved for the control period."""
        exponent = -np.array(self.bandwidth_rad_s) * sampling.period_s
        parameters = np.concatenate([np.exp(exponent), -np.expm1(exponent) / sampling.period_s])
        return Estimator(self.kind, step, parameters, np.zeros(9))

    def derived(self, sampling: Sampling) -> Derived:
        """Return noise gain and lag, exact."""
        T, share = sampling.period_s, np.array(self.bandwidth_rad_s) * sampling.period_s
        gain = -np.expm1(-share)  # 1 - p
        return Derived(gain * np.sqrt(2 / (2 - gain)) / T, 0.5 * T / np.tanh(0.5 * share))


def step(angle: Array, parameters: Array, state: Array, rate: Array) -> None:
    """Write the rates of one control tick; see `estimator.Estimator`."""
    for axis in range(3):
        measured = usable(angle[axis])
        if np.isnan(measured):
            state[STARTED + axis], rate[axis] = 0.0, np.nan
            continue
        if state[STARTED + axis] == 0.0:
            state[STARTED + axis], state[ANGLE + axis], state[RATE + axis] = 1.0, measured, 0.0
        change = measured - state[ANGLE + axis]
        decay, gain = parameters[DECAY + axis], parameters[GAIN + axis]
        if jumped(change, (1.0 - decay) / gain):
            rate[axis] = state[RATE + axis]
        else:
            rate[axis] = decay * state[RATE + axis] + gain * change
        state[ANGLE + axis], state[RATE + axis] = measured, rate[axis]
