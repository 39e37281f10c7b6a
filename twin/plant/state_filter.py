r"""Extended Kalman filter of the plant: angles, rates and disturbance torque from currents and angles.

*State.* Hinge angles q, rates v and a torque d that is subtracted as a disturbance is; if wanted also the
offsets o of the angle sensors. Angles and rates obey `plant_step.step`, d is a random walk.

*Prediction.* The mean passes the plant step, its covariance the step's slopes by finite differences.

*Measurement.* The channels are independent of each other and are used one after another. A channel with
Gaussian noise gives the usual correction. A channel that counts says only that the noisy angle is within half
a count: it is distributed as a truncated normal, whose mean and variance take the place of the measured angle
and of 0 in the correction (assumed density filter). With ``z = (y ± h − m)/s`` and ``Z = Φ(z₊) − Φ(z₋)``:

    mean m + s (φ(z₋) − φ(z₊))/Z,    variance s² (1 + (z₋ φ(z₋) − z₊ φ(z₊))/Z − ((φ(z₋) − φ(z₊))/Z)²).
"""

from __future__ import annotations

from math import erfc, exp, inf, isnan, log, pi, sqrt
from typing import NamedTuple

import numpy as np

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free, compiled
from spheretwin.models.base.record import Rows
from spheretwin.plant.learned_torque import LearnedTorque, learned_torques
from spheretwin.plant.plant_step import Parameters, State
from spheretwin.plant.plant_step import step_of_checked as step

STATES = 9
"""Angles, rates, disturbance; three offsets may follow."""

# Differences for the slopes of a step: small against a degree and against the rate at which smoothed friction
# changes sign, large against rounding.
_DIFFERENCE = (1e-6, 1e-5, 1e-6)  # rad, rad/s, N·m

# Beyond it, Mills' ratio is a continued fraction, whose terms give all digits there.
_FAR, _TERMS = 6.0, 40


class StateFilter(NamedTuple):
    """Filter in progress; its arrays are changed."""

    mean: Array  # (9 or 12,) rad, rad/s, N·m, rad
    covariance: Array  # (9 or 12, 9 or 12)
    noise_rad: Array  # (3,) standard deviation of the noise of each channel, before it counts
    half_count_rad: Array  # (3,) half the interval of a channel that counts; 0: Gaussian
    density: Array  # (9 or 12,) growth of the variances per second
    torque_noise_Nm_s: float  # white torque on each hinge: root of its density, N·m·√s
    longest_step_s: float
    slopes: Array  # (9 or 12, 9 or 12) working space
    product: Array  # (9 or 12, 9 or 12) working space
    learned: Rows = LearnedTorque.zeros()  # array of one learned torque of the machine


class Estimates(NamedTuple):
    """Results of the filter for each row."""

    mean: Array  # (n, 9 or 12)
    deviation: Array  # (n, 9 or 12)
    innovation_rad: Array  # (n, 3) measured minus predicted angle
    expected_rad: Array  # (n, 3) standard deviation of it


@compiled
def run_filter(
    filter: StateFilter,
    parameters: Parameters,
    edge_s: Array,
    mean_A: Array,
    angle_rad: Array,
    estimates: Estimates,
    likelihood: float,
) -> float:
    """Advance the filter over rows of a log.

    Parameters
    ----------
    filter : StateFilter
        Changed.
    parameters : Parameters
        Of the plant step.
    edge_s : (n + 1,) array, s
        Time of the filter's state, and of each row.
    mean_A : (n, groups) array, A
        Mean current until each row.
    angle_rad : (n, 3) array, rad
        Measured angles; NaN is not used.
    estimates : Estimates
        Result.
    likelihood : float
        Logarithm of the likelihood of the angles before.

    Returns
    -------
    float
        The same with these angles.
    """
    for k in range(angle_rad.shape[0]):
        time = edge_s[k + 1] - edge_s[k]
        steps = max(1, int(np.ceil(time / filter.longest_step_s - 1e-6)))
        for _ in range(steps if time > 0.0 else 0):
            _predict(filter, parameters, mean_A[k], time / steps)
        for i in range(3):
            estimates.innovation_rad[k, i] = estimates.expected_rad[k, i] = np.nan
            if not isnan(angle_rad[k, i]):
                likelihood += _correct(filter, i, angle_rad[k, i], k, estimates)
        for i in range(filter.mean.shape[0]):
            estimates.mean[k, i] = filter.mean[i]
            estimates.deviation[k, i] = sqrt(filter.covariance[i, i])
    return likelihood


@compiled
def _predict(filter: StateFilter, parameters: Parameters, current: Array, dt: float) -> None:
    """Advance mean and covariance by one plant step."""
    mean, P, F, product = filter.mean, filter.covariance, filter.slopes, filter.product
    size, white = mean.shape[0], filter.torque_noise_Nm_s**2 / dt
    start = State(mean[:3].copy(), mean[3:6].copy())
    torque = mean[6:9].copy()
    if filter.learned[0].on:  # its slopes are neglected
        middle = start.q_rad + 0.5 * dt * start.qdot_rad_s
        torque -= learned_torques(
            filter.learned, parameters, middle.reshape(1, 3), mean[3:6].copy().reshape(1, 3), current
        )[0]
    end = step(start, current, torque, parameters, dt)
    for column in range(STATES):
        kind, i = column // 3, column % 3
        difference = _DIFFERENCE[kind]
        moved = (start.q_rad, start.qdot_rad_s, torque)[kind]
        before = moved[i]
        moved[i] = before + difference
        other = step(start, current, torque, parameters, dt)
        moved[i] = before
        for row in range(3):
            F[row, column] = (other.q_rad[row] - end.q_rad[row]) / difference
            F[3 + row, column] = (other.qdot_rad_s[row] - end.qdot_rad_s[row]) / difference
    mean[:3], mean[3:6] = end.q_rad, end.qdot_rad_s
    # Below its first six rows F is the unit matrix.
    for i in range(size):
        for j in range(size):
            total = P[i, j] if i >= 6 else 0.0
            if i < 6:
                for k in range(STATES):
                    total += F[i, k] * P[k, j]
            product[i, j] = total
    for i in range(size):
        for j in range(i + 1):
            total = product[i, j] if j >= 6 else 0.0
            if j < 6:
                for k in range(STATES):
                    total += product[i, k] * F[j, k]
            if i < 6:
                for k in range(6, STATES):
                    total += white * F[i, k] * F[j, k]
            P[i, j] = P[j, i] = total
        P[i, i] += filter.density[i] * dt


@allocation_free
def _correct(filter: StateFilter, channel: int, angle: float, row: int, estimates: Estimates) -> float:
    """Use one measured angle; return the logarithm of its likelihood."""
    mean, P, gain = filter.mean, filter.covariance, filter.product[0]
    size, offset = mean.shape[0], STATES + channel
    predicted = mean[channel]
    for i in range(size):
        gain[i] = P[i, channel]
    variance = P[channel, channel]
    if size > STATES:
        predicted += mean[offset]
        for i in range(size):
            gain[i] += P[i, offset]
        variance = gain[channel] + gain[offset]
    half, innovation = filter.half_count_rad[channel], angle - predicted
    spread = variance + filter.noise_rad[channel] ** 2
    expected = spread + half * half / 3.0
    estimates.innovation_rad[row, channel], estimates.expected_rad[row, channel] = innovation, sqrt(expected)
    if half > 0.0:
        likelihood, shift, ratio = _truncated(innovation, half, sqrt(spread))
    else:
        likelihood, shift, ratio = (
            -0.5 * (log(2.0 * pi * spread) + innovation**2 / spread),
            innovation,
            0.0,
        )
    for i in range(size):
        gain[i] /= spread
        mean[i] += gain[i] * shift
    for i in range(size):
        for j in range(i + 1):
            P[i, j] -= gain[i] * gain[j] * spread * (1.0 - ratio)
            P[j, i] = P[i, j]
    return likelihood


@allocation_free
def _truncated(centre: float, half: float, deviation: float) -> tuple[float, float, float]:
    """Return of a normal distribution about 0, within an interval: log share, mean, share of the variance.

    The tail is computed with the density at the near end as a factor apart, so it does not underflow.
    """
    side = 1.0 if centre >= 0.0 else -1.0
    low, high = (side * centre - half) / deviation, (side * centre + half) / deviation
    decay = exp(-2.0 * half * side * centre / deviation**2)  # density at the far end over that at the near
    if low > 0.0:
        share, beyond = _tail(low) - decay * _tail(high), -0.5 * (low * low + log(2.0 * pi))
    else:  # the mean is inside; of a distribution far narrower than the interval, the density ends as 0
        share, beyond = 0.5 * (erfc(-high / sqrt(2.0)) - erfc(-low / sqrt(2.0))), 0.0
    if not share > 0.0:  # far narrower than the spacing of numbers at its place
        return -inf, centre, 0.0
    density = 1.0 / share if low > 0.0 else exp(-0.5 * low * low) / (sqrt(2.0 * pi) * share)
    first = (1.0 - decay) * density
    ratio = 1.0 + (low - decay * high) * density - first * first
    return log(share) + beyond, side * deviation * first, min(max(ratio, 0.0), 1.0)


@allocation_free
def _tail(x: float) -> float:
    """Return the normal distribution beyond x > 0 over its density at x, Mills' ratio."""
    if x < _FAR:
        return sqrt(0.5 * pi) * exp(0.5 * x * x) * erfc(x / sqrt(2.0))
    fraction = x
    for k in range(_TERMS, 0, -1):
        fraction = x + k / fraction
    return 1.0 / fraction
