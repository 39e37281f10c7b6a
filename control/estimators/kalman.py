r"""Kalman filter of angle and rate, one for each axis, with its steady-state gain.

*Model.* The rate is constant except for white acceleration of density q (rad²/s³), the angle is measured with
white noise of variance σ² once a period T. A model of one order more (constant acceleration) would have no
lag for a ramp of the rate. At the same bandwidth it passes several times the noise, and its gain has a peak
above 1. The torque on this rotor changes with the currents within a millisecond, so the acceleration is
closer to white noise. For no lag use `differentiator`.

*Filter.* Predict x⁻ = x + T v; with the innovation e = y − x⁻ correct x = x⁻ + α e, v += (β/T) e:

    V/Y = (β/T) · z (z − 1) / (z² + (α + β − 2) z + 1 − α).

*Gain.* The spectrum of the innovation is that of the samples, differenced twice. With x = 2 − z − 1/z, white
noise gives σ² x², and white acceleration q T³ (1 − x/6), including the hold between samples. The filter's
poles are their common zeros within the unit circle:

    x² − (κ/6) x + κ = 0,      κ = q T³/σ²,      δ = 1 − z = x/2 ± √(x²/4 − x), |1 − δ| < 1,

and by comparing coefficients α = δ₁ + δ₂ − δ₁δ₂, β = δ₁δ₂: the Riccati equation solved in closed form.

*Tuning.* Only κ matters. For small T the filter is ω²/(s² + √2 ω s + ω²) from rate to rate, Butterworth's,
with ω⁴ = q/(σ² T), so κ = (ωT)⁴ and ω is the bandwidth. It is the parameter; if a density q is
given instead, ω follows from it and the noise of the sensors.

*Noise gain.* From the filter's Lyapunov equation, exact, and for small T:

    var v / σ² = 2 β² / (T² α (4 − 2 α − β))      →  ω³ T / (2 √2).

Unlike that of the difference it decreases with the period: all samples within 1/ω are averaged.

*Lag.* For y = ½ a t² the innovation e = a T²/β remains, and the correction of v gives lag = α T/β − T/2,
near √2/ω.

A ramp of the angle is followed with an error that decreases by |z| ≈ e^(−ωT/√2) at each tick.

*Default.* ω = 400 1/s has about the noise of the filtered difference at its default and less than half of
its lag. As a filter of second order it causes more phase loss in the loop at the same lag.
"""

from functools import lru_cache
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spheretwin.control.estimators.estimator import (
    BandwidthEach,
    Derived,
    Estimator,
    EstimatorParameters,
    FASTEST_rad_s,
    Sampling,
    SLOWEST_rad_s,
    bandwidth_field,
    jumped,
    named,
    usable,
    within_range,
)
from spheretwin.control.law import NonNegativeEach, each
from spheretwin.models.base.arrays import Array

OF_ANGLE, OF_RATE, PERIOD, FILTERS = 0, 3, 6, 7  # layout of the parameters: alpha, beta / T
STARTED, ANGLE, RATE, LAST = 0, 3, 6, 9  # layout of the memory


class Kalman(EstimatorParameters):
    """Steady-state Kalman filter of angle and rate."""

    kind: Literal["kalman"] = named("kalman")
    bandwidth_rad_s: BandwidthEach = bandwidth_field(400.0)
    acceleration_density_rad2_s3: NonNegativeEach = Field(
        each(0.0), description="of white acceleration, rad²/s³; 0: derived from the bandwidth"
    )
    noise_rad: NonNegativeEach = Field(
        each(0.0),
        description="standard deviation of the angles, used with the density, rad; 0: that of the sensors",
    )
    filters_angle: Annotated[bool, Field(description="whether the law also receives the filtered angles")] = (
        False
    )

    def build(self, sampling: Sampling) -> Estimator:
        """Return the estimator with the steady-state gain.

        Raises
        ------
        InputError
            A density is given, and the bandwidth that follows from it and the noise is out of range.
        """
        share = self._bandwidth(sampling) * sampling.period_s
        of_angle, of_rate = _cached_gains(*share.tolist())
        numbers = [*of_angle, *(of_rate / sampling.period_s), sampling.period_s, float(self.filters_angle)]
        return Estimator(self.kind, step, np.array(numbers), np.zeros(12))

    def derived(self, sampling: Sampling) -> Derived:
        """Return noise gain and lag, exact."""
        T = sampling.period_s
        alpha, beta = gains(self._bandwidth(sampling) * T)
        noise_gain = beta / T * np.sqrt(2 / (alpha * (4 - 2 * alpha - beta)))
        return Derived(noise_gain, T * (alpha / beta - 0.5))

    def _bandwidth(self, sampling: Sampling) -> NDArray[np.float64]:
        density, noise = np.array(self.acceleration_density_rad2_s3), np.array(self.noise_rad)
        noise = np.where(noise > 0, noise, sampling.deviation_rad())
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):  # without noise: out of range
            derived = np.sqrt(np.sqrt(density / sampling.period_s) / noise)
        bandwidth = np.where(density > 0, derived, self.bandwidth_rad_s)
        within_range(self.kind, "bandwidth in rad/s", bandwidth, SLOWEST_rad_s, FASTEST_rad_s)
        return bandwidth


def gains(share: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the steady-state gains α and β.

    Parameters
    ----------
    share : (n,) array
        Bandwidth times period, ωT.

    Returns
    -------
    alpha, beta : (n,) array
    """
    sum_of_roots = share**4 / 6
    spread = np.emath.sqrt((0.5 * sum_of_roots) ** 2 - share**4)
    deltas = [_inner_root(0.5 * sum_of_roots + spread), _inner_root(share**4 / (0.5 * sum_of_roots + spread))]
    product = np.real(deltas[0] * deltas[1])
    return np.real(deltas[0] + deltas[1]) - product, product


@lru_cache(maxsize=32)
def _cached_gains(*share: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return `gains` from a cache, read-only: the rows of a study share the slow computation."""
    return gains(np.array(share))


def _inner_root(x: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the δ of 2 − z − 1/z = x whose z = 1 − δ lies within the unit circle.

    The two solutions are x/2 plus and minus the root; the δ nearer to 1 is taken, as the two z are inverse to
    each other.
    """
    root = np.emath.sqrt(0.25 * x * x - x)
    first, second = 0.5 * x + root, 0.5 * x - root
    outer = np.where(np.abs(1 - first) > np.abs(1 - second), first, second)
    return x / outer  # their product is x: no cancellation where x is large


def step(angle: Array, parameters: Array, state: Array, rate: Array) -> None:
    """Write the rates of one control tick; see `estimator.Estimator`."""
    period = parameters[PERIOD]
    for axis in range(3):
        measured = usable(angle[axis])
        if np.isnan(measured):
            state[STARTED + axis], rate[axis] = 0.0, np.nan
            continue
        if state[STARTED + axis] == 0.0:
            state[STARTED + axis], state[ANGLE + axis], state[RATE + axis] = 1.0, measured, 0.0
            state[LAST + axis] = measured
        change, state[LAST + axis] = measured - state[LAST + axis], measured
        if jumped(change, period):
            state[ANGLE + axis], rate[axis] = measured, state[RATE + axis]
            continue
        predicted = state[ANGLE + axis] + period * state[RATE + axis]
        innovation = measured - predicted
        state[ANGLE + axis] = predicted + parameters[OF_ANGLE + axis] * innovation
        state[RATE + axis] += parameters[OF_RATE + axis] * innovation
        rate[axis] = state[RATE + axis]
        if parameters[FILTERS] != 0.0:
            angle[axis] = state[ANGLE + axis]
