r"""Levant's robust exact differentiator of second order, discretised without chatter.

*In continuous time* (A. Levant, Automatica 34, 1998, and Int. J. Control 76, 2003, with its coefficients),
for an angle f whose jerk stays below L, with e = z₀ − f:

    ż₀ = z₁ − 2 L^⅓ |e|^⅔ sgn e,    ż₁ = z₂ − 2.12 L^⅔ |e|^⅓ sgn e,    ż₂ = −1.1 L sgn e.

After a finite time z₀ = f, z₁ = ḟ, z₂ = f̈ exactly; with noise below ε the rate is wrong by a multiple of
L^⅓ ε^⅔, the best order that any differentiator can have.

*Sampled.* An explicit Euler step would make z₂ jump by 1.1 L T about its value for ever. Here e on the
right-hand side is the error *after* the step (implicit; compare Koch et al., IEEE Trans. Autom. Control 65,
2020), and the prediction z⁻ is that of a parabola. With r = |z₀⁻ − y|/(L T³), and all signs those of z₀⁻ −
y, the error after the step is L T³ u³, where u ≥ 0 solves

    u³ + 2 u² + 2.12 u + min(r, 1.1) = r,

which has one solution, as the left side increases with u; and u = 0 if r ≤ 1.1, where Filippov's sgn 0 takes
the required value between −1 and 1. Then z₁ = z₁⁻ − L T² (2.12 u + 1.5 h), z₂ = z₂⁻ − L T h, h = min(r, 1.1).

The weight 1.5: where u = 0 the step is linear, z₀ = y, with 1, w/T, 1/T² of the innovation to the three, and
the poles of z² + (w − 1.5) z + 1.5 − w. For w = 1.5 both are 0: after three ticks z₁ is the slope at the end
of the parabola through the last three samples, exact for a constant acceleration and without chatter.
(A zero-order hold of the last term over the period would weight it by 1/6, 1/2, 1: with u = 0 that inverts a
sampled triple integrator, one of whose zeros is at −3.7, and the chatter would return.)

*Noise gain*, approximate. Where noise of deviation σ dominates e, each power of it acts on the small rest as
its mean slope: |e|^p sgn e as m_p σ^(p−1) e, m_p = 2^((p+1)/2) Γ(p/2 + 1)/√π. With ω₀ = (L/σ)^⅓ this leaves
from rate to rate

    (l₂ s + l₃)/(s³ + l₁ s² + l₂ s + l₃),   l₁ = 2 m_⅔ ω₀ = 1.80 ω₀,  l₂ = 2.12 m_⅓ ω₀² = 1.76 ω₀²,
                                            l₃ = 1.1 m₀ ω₀³ = 0.88 ω₀³,

whose gain falls by 3 dB at 1.65 ω₀ (below that it rises to 1.8 at 0.83 ω₀: the cost of no lag). The powers
drive it with their whole variance, that of |σn|^p|σn|^q being σ^(p+q) 2^((p+q)/2) Γ((p+q+1)/2)/√π for each
two; the Lyapunov equation of the three states then gives

    var v / σ² = 2.11 T ω₀³ = 0.47 T ω³,

within a few per cent while ωT < 0.3: a third more than `kalman` at the same bandwidth.

*Lag.* None for a ramp of the rate: the numerator has the last two terms of the denominator.

*Tuning.* L = σ (ω/1.65)³ for the bandwidth ω; it must exceed the jerk of the motion, otherwise the estimate
loses it. If the largest jerk is known it is given instead. After a jump of the rate by v the estimate is
exact within 3.1 √(v/L) and three ticks (by simulation; √(v/L) is the only time scale, by homogeneity),
not after a number of 1/ω: an estimator that is robust to noise is slow after a jump larger than the noise.

*Default.* ω = 800 1/s, where noise of 0.02° rms gives L = 40,000 rad/s³ and more noise of the rate than the
other estimators have. The motion of the paper's sinusoid alone, of 6 rad/s³, needs much less, but the
loop causes further motions: with a small ω the estimate recovers late after a jump of the rate, and the loop
becomes unstable. For references with corners and for load steps, a linear estimator is the better choice.
"""

import math
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

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
    within_range,
)
from spheretwin.control.law import NonNegativeEach, each
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free

OUTER, MIDDLE, INNER = 2.0, 2.12, 1.1  # Levant's coefficients, from z0 to z2
END_SLOPE = 1.5  # weight of the innermost term in z1: slope of a parabola at its end
PERIOD, FILTERS, JERK = 0, 1, 2  # layout of the parameters
STARTED, ANGLE, RATE, ACCELERATION, LAST = 0, 3, 6, 9, 12  # layout of the memory

UNKNOWN_NOISE_rad = math.radians(0.02)  # the prototype's potentiometers, if no noise is given
LEAST_JERK_rad_s3, LARGEST_JERK_rad_s3 = 1e-30, 1e30  # beyond these its products with periods underflow


def _mean_gain(power: float) -> float:
    """Return the mean slope of a signed power under a standard normal distribution: m_p."""
    return 2 ** ((power + 1) / 2) * math.gamma(power / 2 + 1) / math.sqrt(math.pi)


L1, L2, L3 = OUTER * _mean_gain(2 / 3), MIDDLE * _mean_gain(1 / 3), INNER * _mean_gain(0)
BANDWIDTH = 1.646549  # of the linear filter with these gains
VARIANCE = 2.113056  # of its rate, per unit of noise density


class Differentiator(EstimatorParameters):
    """Levant's differentiator of second order, implicit."""

    kind: Literal["differentiator"] = named("differentiator")
    bandwidth_rad_s: BandwidthEach = bandwidth_field(800.0)
    largest_jerk_rad_s3: NonNegativeEach = Field(
        each(0.0), description="of the motion, rad/s³; 0: derived from noise and bandwidth"
    )
    noise_rad: NonNegativeEach = Field(
        each(0.0), description="standard deviation of the angles, rad; 0: that of the sensors, or else 0.02°"
    )
    filters_angle: Annotated[bool, Field(description="whether the law also receives the filtered angles")] = (
        False
    )

    def build(self, sampling: Sampling) -> Estimator:
        """Return the estimator for the given largest jerk, or the one derived from noise and bandwidth.

        Raises
        ------
        InputError
            That jerk is too small or too large to compute with.
        """
        numbers = [sampling.period_s, float(self.filters_angle), *self.jerk(sampling)]
        return Estimator(self.kind, step, np.array(numbers), np.zeros(15))

    def derived(self, sampling: Sampling) -> Derived:
        """Return the approximate noise gain if noise dominates the error, and no lag."""
        omega_0 = np.cbrt(self.jerk(sampling) / self._noise(sampling))
        return Derived(np.sqrt(VARIANCE * sampling.period_s * omega_0**3), np.zeros(3))

    def jerk(self, sampling: Sampling) -> NDArray[np.float64]:
        """Return the bound L of the jerk, (3,) in rad/s³."""
        given_jerk, bandwidth = np.array(self.largest_jerk_rad_s3), np.array(self.bandwidth_rad_s)
        jerk = np.where(given_jerk > 0, given_jerk, self._noise(sampling) * (bandwidth / BANDWIDTH) ** 3)
        within_range(self.kind, "largest jerk in rad/s³", jerk, LEAST_JERK_rad_s3, LARGEST_JERK_rad_s3)
        return jerk

    def _noise(self, sampling: Sampling) -> NDArray[np.float64]:
        noise_rad = np.where(np.array(self.noise_rad) > 0, self.noise_rad, sampling.deviation_rad())
        return np.where(noise_rad > 0, noise_rad, UNKNOWN_NOISE_rad)


@allocation_free
def root(rest: float) -> float:
    """Return the u ≥ 0 with u³ + 2 u² + 2.12 u = rest ≥ 0.

    Newton's method from above on an increasing convex function: it descends to the root and ends if rounding
    prevents a further descent. It starts at the smallest root of a single term, where the function is at most
    three times too large; slightly above it, as a power of 1/3 in floating point is not exactly the cube
    root.
    """
    u = min(rest ** (1 / 3), math.sqrt(rest / OUTER), rest / MIDDLE) * (1 + 1e-12)
    while True:
        excess = ((u + OUTER) * u + MIDDLE) * u - rest
        lower = u - excess / ((3 * u + 2 * OUTER) * u + MIDDLE)
        if not lower < u:
            return u
        u = lower


def step(angle: Array, parameters: Array, state: Array, rate: Array) -> None:
    """Write the rates of one control tick; see `estimator.Estimator`."""
    T = parameters[PERIOD]
    for axis in range(3):
        measured = usable(angle[axis])
        if np.isnan(measured):
            state[STARTED + axis], rate[axis] = 0.0, np.nan
            continue
        if state[STARTED + axis] == 0.0:
            state[STARTED + axis], state[ANGLE + axis], state[LAST + axis] = 1.0, measured, measured
            state[RATE + axis] = state[ACCELERATION + axis] = 0.0
        change, state[LAST + axis] = measured - state[LAST + axis], measured
        if jumped(change, T):
            state[ANGLE + axis], state[ACCELERATION + axis], rate[axis] = measured, 0.0, state[RATE + axis]
            continue
        unit = parameters[JERK + axis] * T  # of acceleration; times T of rate, times T² of angle
        predicted_rate = state[RATE + axis] + T * state[ACCELERATION + axis]
        ahead = state[ANGLE + axis] + 0.5 * T * (state[RATE + axis] + predicted_rate) - measured
        error = abs(ahead) / (unit * T * T)
        clipped = min(error, INNER)
        u = root(error - clipped)
        sign = math.copysign(1.0, ahead)
        state[ANGLE + axis] = measured + sign * (unit * T * T) * (u * u * u)
        state[RATE + axis] = predicted_rate - sign * (unit * T) * (MIDDLE * u + END_SLOPE * clipped)
        state[ACCELERATION + axis] -= sign * unit * clipped
        rate[axis] = state[RATE + axis]
        if parameters[FILTERS] != 0.0:
            angle[axis] = state[ANGLE + axis]
