r"""Filtered difference: the backward difference of the angle through a first-order low-pass.

With the period T, the bandwidth ω and p = e^(−ωT),

    v_k = p v_(k−1) + (1 − p) (y_k − y_(k−1)) / T,      V/Y = (1 − p)/T · (1 − z⁻¹)/(1 − p z⁻¹).

This is the low-pass ω/(s + ω) solved exactly, for an angle that moves straight from one sample to the next:
the difference is the rate that it has all that time.

*Noise gain.* The response to an impulse of the angle is (1 − p)/T at once and −p^(n−1) (1 − p)²/T at the n-th
tick after. White noise of variance σ² adds their squares:

    var v / σ² = (1 − p)²/T² · (1 + (1 − p)²/(1 − p²)) = 2 (1 − p)² / (T² (1 + p)).

It tends to ω² for ωT ≪ 1: σ ω, however often the angle is sampled. Sampling faster does not help, which is
what is to be said against this estimator; a filter of second order (`kalman`) makes use of every sample.

*Lag.* With y = ½ a t² the difference is a (t − T/2): half a period of its own. In v = a (t − lag) follows

    lag = T/2 + p T/(1 − p) = (T/2) coth(ωT/2),         near 1/ω.

A ramp of the angle is followed with an error that falls by p at each tick; a constant one gives rate 0.

*Default.* ω = 150 1/s, half as much again as AFSM needs on the prototype. In slow motion a count c of an
encoder is a pulse of (1 − p) c/T, which decays in 1/ω.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.estimators.estimator import (
    BandwidthEach,
    Derived,
    Estimator,
    EstimatorParameters,
    Sampling,
    bandwidth_field,
    named,
    usable,
)

Array = NDArray[np.float64]

KEPT, GAIN = 0, 3  # layout of the parameters: p, and (1 - p) / T
STARTED, ANGLE, RATE = 0, 3, 6  # layout of the memory


class Difference(EstimatorParameters):
    """Filtered difference."""

    kind: Literal["difference"] = named("difference")
    bandwidth_rad_s: BandwidthEach = bandwidth_field(150.0)

    def build(self, sampling: Sampling) -> Estimator:
        """Estimator with the low-pass solved for the control period."""
        exponent = -np.array(self.bandwidth_rad_s) * sampling.period_s
        parameters = np.concatenate([np.exp(exponent), -np.expm1(exponent) / sampling.period_s])
        return Estimator(self.kind, step, parameters, np.zeros(9))

    def derived(self, sampling: Sampling) -> Derived:
        """Noise gain and lag, exact."""
        T, share = sampling.period_s, np.array(self.bandwidth_rad_s) * sampling.period_s
        rest = -np.expm1(-share)  # 1 - p
        return Derived(rest * np.sqrt(2 / (2 - rest)) / T, 0.5 * T / np.tanh(0.5 * share))


def step(angle: Array, parameters: Array, state: Array, rate: Array) -> None:
    """Write the rates of one control tick, as `estimator.Estimator` says."""
    for axis in range(3):
        measured = usable(angle[axis])
        if np.isnan(measured):
            state[STARTED + axis], rate[axis] = 0.0, np.nan
            continue
        if state[STARTED + axis] == 0.0:
            state[STARTED + axis], state[ANGLE + axis], state[RATE + axis] = 1.0, measured, 0.0
        moved = measured - state[ANGLE + axis]
        rate[axis] = parameters[KEPT + axis] * state[RATE + axis] + parameters[GAIN + axis] * moved
        state[ANGLE + axis], state[RATE + axis] = measured, rate[axis]
