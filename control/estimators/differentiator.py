r"""Levant's robust exact differentiator of second order, discretised so that it does not chatter.

*In continuous time* (A. Levant, Automatica 34, 1998, and Int. J. Control 76, 2003, with its coefficients),
for an angle f whose jerk stays below L, with e = z₀ − f:

    ż₀ = z₁ − 2 L^⅓ |e|^⅔ sgn e,    ż₁ = z₂ − 2.12 L^⅔ |e|^⅓ sgn e,    ż₂ = −1.1 L sgn e.

After a finite time z₀ = f, z₁ = ḟ, z₂ = f̈ exactly; with noise below ε the rate is wrong by a multiple of
L^⅓ ε^⅔, the best order that any differentiator can have.

*Sampled.* Euler's step would keep z₂ jumping by 1.1 L T about its value for ever. Here e on the right-hand
side is the error *after* the step (implicit; compare Koch et al., IEEE Trans. Autom. Control 65, 2020), and
the prediction z⁻ is that of a parabola. With r = |z₀⁻ − y|/(L T³), and all signs those of z₀⁻ − y, the error
after the step is L T³ u³, where u ≥ 0 solves

    u³ + 2 u² + 2.12 u + min(r, 1.1) = r,

one number, as the left side grows with u; and u = 0 where r ≤ 1.1, where Filippov's sgn 0 takes the value
between −1 and 1 that is needed. Then z₁ = z₁⁻ − L T² (2.12 u + 1.5 h), z₂ = z₂⁻ − L T h, h = min(r, 1.1).

The weight 1.5: where u = 0 the step is linear, z₀ = y, with 1, w/T, 1/T² of the innovation to the three, and
the poles of z² + (w − 1.5) z + 1.5 − w. For w = 1.5 both are 0: after three ticks z₁ is the slope at the end
of the parabola through the last three samples, exact for a steady acceleration, and no chatter is left.
(To hold the last term over the period would weigh it 1/6, 1/2, 1: with u = 0 that inverts a sampled triple
integrator, one of whose zeros is at −3.7, and the chatter would be back.)

*Noise gain*, approximate. Where noise of deviation σ dominates e, each power of it acts on the small rest as
its mean slope: |e|^p sgn e as m_p σ^(p−1) e, m_p = 2^((p+1)/2) Γ(p/2 + 1)/√π. With ω₀ = (L/σ)^⅓ this leaves
from rate to rate

    (l₂ s + l₃)/(s³ + l₁ s² + l₂ s + l₃),   l₁ = 2 m_⅔ ω₀ = 1.80 ω₀,  l₂ = 2.12 m_⅓ ω₀² = 1.76 ω₀²,
                                            l₃ = 1.1 m₀ ω₀³ = 0.88 ω₀³,

whose gain falls by 3 dB at 1.65 ω₀ (before that it rises to 1.8 at 0.83 ω₀: the price of no lag). The powers
drive it with all of their variance, that of |σn|^p|σn|^q being σ^(p+q) 2^((p+q)/2) Γ((p+q+1)/2)/√π for each
two; the Lyapunov equation of the three states then gives

    var v / σ² = 2.11 T ω₀³ = 0.47 T ω³,

within a few per cent while ωT < 0.3: a third more than `kalman` at the same bandwidth.

*Lag.* None behind a ramp of the rate: the numerator has the last two terms of the denominator.

*Tuning.* L = σ (ω/1.65)³ for the bandwidth ω; it must exceed the motion's jerk, or the estimate loses it.
Where a largest jerk is known it is given instead. After a jump of the rate by v the estimate is exact within
3.1 √(v/L) and three ticks (by simulation; that √(v/L) is the only time there is follows from homogeneity),
not after so many 1/ω: what is robust to noise is slow after a jump larger than noise.

*Default.* ω = 800 1/s, where noise of 0.02° rms gives L = 40,000 rad/s³ and more noise of the rate than the
other estimators have. The motion of the paper's sinusoid alone, of 6 rad/s³, would do with much less, but a
loop makes motions of its own: at a small ω the estimate comes back late after a jump of the rate, and the
loop loses the rotor. Where references have corners and loads jump, a linear estimator is the better choice.
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
    named,
    usable,
    within_range,
)
from spheretwin.control.law import NonNegativeEach, each
from spheretwin.models.base.compiled import allocation_free

Array = NDArray[np.float64]

OUTER, MIDDLE, INNER = 2.0, 2.12, 1.1  # Levant's coefficients, from z0 to z2
END_SLOPE = 1.5  # weight of the innermost term in z1: a parabola's slope at its end
PERIOD, FILTERS, JERK = 0, 1, 2  # layout of the parameters
STARTED, ANGLE, RATE, ACCELERATION = 0, 3, 6, 9  # layout of the memory

UNKNOWN_NOISE_rad = math.radians(0.02)  # the prototype's potentiometers, where no noise is told
LEAST_JERK_rad_s3, LARGEST_JERK_rad_s3 = 1e-30, 1e30  # beyond these its products with periods underflow


def _mean_gain(power: float) -> float:
    """Mean slope of a signed power at a normal number of deviation 1: m_p."""
    return 2 ** ((power + 1) / 2) * math.gamma(power / 2 + 1) / math.sqrt(math.pi)


L1, L2, L3 = OUTER * _mean_gain(2 / 3), MIDDLE * _mean_gain(1 / 3), INNER * _mean_gain(0)
BANDWIDTH = 1.646549  # of the linear filter with these gains
VARIANCE = 2.113056  # of its rate, a unit of noise density


class Differentiator(EstimatorParameters):
    """Levant's differentiator of second order, implicit."""

    kind: Literal["differentiator"] = named("differentiator")
    bandwidth_rad_s: BandwidthEach = bandwidth_field(800.0)
    largest_jerk_rad_s3: NonNegativeEach = Field(
        each(0.0), description="of the motion, rad/s³; 0: what noise and bandwidth lead to"
    )
    noise_rad: NonNegativeEach = Field(
        each(0.0), description="standard deviation of the angles, rad; 0: the sensors' own, or else 0.02°"
    )
    filters_angle: Annotated[bool, Field(description="whether the law gets the filtered angles too")] = False

    def build(self, sampling: Sampling) -> Estimator:
        """Estimator for the largest jerk that is given, or that noise and bandwidth lead to.

        Raises
        ------
        InputError
            That jerk is too small or too large to compute with.
        """
        numbers = [sampling.period_s, float(self.filters_angle), *self.jerk(sampling)]
        return Estimator(self.kind, step, np.array(numbers), np.zeros(12))

    def derived(self, sampling: Sampling) -> Derived:
        """Noise gain where noise dominates the error, approximate, and no lag."""
        own = np.cbrt(self.jerk(sampling) / self._noise(sampling))
        return Derived(np.sqrt(VARIANCE * sampling.period_s * own**3), np.zeros(3))

    def jerk(self, sampling: Sampling) -> NDArray[np.float64]:
        """Bound L of the jerk, (3,) in rad/s³."""
        given, bandwidth = np.array(self.largest_jerk_rad_s3), np.array(self.bandwidth_rad_s)
        jerk = np.where(given > 0, given, self._noise(sampling) * (bandwidth / BANDWIDTH) ** 3)
        within_range(self.kind, "largest jerk in rad/s³", jerk, LEAST_JERK_rad_s3, LARGEST_JERK_rad_s3)
        return jerk

    def _noise(self, sampling: Sampling) -> NDArray[np.float64]:
        told = np.where(np.array(self.noise_rad) > 0, self.noise_rad, sampling.deviation_rad())
        return np.where(told > 0, told, UNKNOWN_NOISE_rad)


@allocation_free
def root(rest: float) -> float:
    """The u ≥ 0 with u³ + 2 u² + 2.12 u = rest ≥ 0.

    Newton's method from above on a function that rises and is bent upward: it descends to the root, and ends
    where rounding lets it descend no more. It starts at the smallest of what each term alone would allow,
    where the function is at most three times as large as it should be; a hair above it, as a power of 1/3
    in floating point is not quite the cube root.
    """
    u = min(rest ** (1 / 3), math.sqrt(rest / OUTER), rest / MIDDLE) * (1 + 1e-12)
    while True:
        excess = ((u + OUTER) * u + MIDDLE) * u - rest
        lower = u - excess / ((3 * u + 2 * OUTER) * u + MIDDLE)
        if not lower < u:
            return u
        u = lower


def step(angle: Array, parameters: Array, state: Array, rate: Array) -> None:
    """Write the rates of one control tick, as `estimator.Estimator` says."""
    T = parameters[PERIOD]
    for axis in range(3):
        measured = usable(angle[axis])
        if np.isnan(measured):
            state[STARTED + axis], rate[axis] = 0.0, np.nan
            continue
        if state[STARTED + axis] == 0.0:
            state[STARTED + axis], state[ANGLE + axis] = 1.0, measured
            state[RATE + axis] = state[ACCELERATION + axis] = 0.0
        unit = parameters[JERK + axis] * T  # of acceleration; times T of rate, times T² of angle
        predicted_rate = state[RATE + axis] + T * state[ACCELERATION + axis]
        ahead = state[ANGLE + axis] + 0.5 * T * (state[RATE + axis] + predicted_rate) - measured
        error = abs(ahead) / (unit * T * T)
        held = min(error, INNER)
        u = root(error - held)
        sign = math.copysign(1.0, ahead)
        state[ANGLE + axis] = measured + sign * (unit * T * T) * (u * u * u)
        state[RATE + axis] = predicted_rate - sign * (unit * T) * (MIDDLE * u + END_SLOPE * held)
        state[ACCELERATION + axis] -= sign * unit * held
        rate[axis] = state[RATE + axis]
        if parameters[FILTERS] != 0.0:
            angle[axis] = state[ANGLE + axis]
