"""Comparison of estimators: error and lag of the rate of a noisy sine by bandwidth, measured and derived."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spheretwin.control.estimators import ESTIMATORS
from spheretwin.control.estimators.estimator import Sampling, estimates
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError

BANDWIDTH = "bandwidth_rad_s"
SETTLING = 0.25  # least share of a record that is not evaluated


class SampledSine(NamedTuple):
    """Sampled sine of the angle; the defaults are the paper's sinusoid on the prototype's potentiometers."""

    amplitude_rad: float = 0.2
    frequency_Hz: float = 0.5
    noise_rad: float = math.radians(0.02)
    period_s: float = 1e-3
    duration_s: float = 64.0
    seed: int = 0


class EstimatorComparison(NamedTuple):
    """Error and lag of one estimator by bandwidth."""

    rms_error_rad_s: Array  # (b,) estimated minus true rate
    lag_s: Array  # (b,) of the estimate's component at the sine's frequency; negative if it leads
    lag_deviation_s: Array  # (b,) standard deviation of the lag, by its scatter over the sine's periods
    derived_rms_error_rad_s: Array  # (b,) by the derived noise gain, and lag times acceleration
    derived_lag_s: Array  # (b,) behind a ramp of the rate: the limit of low frequencies
    default_rad_s: float  # bandwidth


def compare(
    bandwidths_rad_s: Sequence[float], motion: SampledSine | None = None
) -> dict[str, EstimatorComparison]:
    """Compare all estimators that have a bandwidth, on the same samples.

    The same sine is on three axes, each with its own noise: lags and squared errors are their means.

    Parameters
    ----------
    bandwidths_rad_s : sequence of float, rad/s
    motion : SampledSine, optional

    Returns
    -------
    dict of kind to EstimatorComparison

    Raises
    ------
    InputError
        The record is too short to evaluate a period.
    """
    motion = motion or SampledSine()
    if (1 - SETTLING) * motion.duration_s * motion.frequency_Hz < 2:
        raise InputError(
            f"motion: expected a duration of at least {2 / (1 - SETTLING) / motion.frequency_Hz:g} s,"
            f" received {motion.duration_s:g}"
        )
    ticks = round(motion.duration_s / motion.period_s)
    t_s = motion.period_s * np.arange(ticks, dtype=np.float64)
    phase = 2 * np.pi * motion.frequency_Hz * t_s
    noise = np.random.default_rng(motion.seed).normal(scale=motion.noise_rad, size=(len(t_s), 3))
    angle_rad = motion.amplitude_rad * np.sin(phase)[:, None] + noise
    return {
        kind: _comparison(bandwidths_rad_s, kind, motion, phase, angle_rad)
        for kind, parameters in ESTIMATORS.items()
        if BANDWIDTH in parameters.model_fields
    }


def _comparison(
    bandwidths_rad_s: Sequence[float], kind: str, motion: SampledSine, phase: Array, angle_rad: Array
) -> EstimatorComparison:
    rows = [_figures(kind, bandwidth, motion, phase, angle_rad) for bandwidth in bandwidths_rad_s]
    rms, lag, deviation, derived_rms, derived_lag = np.array(rows).T
    default = ESTIMATORS[kind].model_fields[BANDWIDTH].default[0]
    return EstimatorComparison(rms, lag, deviation, derived_rms, derived_lag, default)


def _figures(
    kind: str, bandwidth_rad_s: float, motion: SampledSine, phase: Array, angle_rad: Array
) -> tuple[float, ...]:
    parameters = ESTIMATORS[kind].model_validate({BANDWIDTH: float(bandwidth_rad_s)})
    sampling = Sampling(motion.period_s, np.full(3, motion.noise_rad), np.zeros(3))
    estimator = parameters.build(sampling)
    assert estimator is not None  # it has a bandwidth
    derived = parameters.derived(sampling)
    pulsation = 2 * np.pi * motion.frequency_Hz
    periods = math.floor((1 - SETTLING) * motion.duration_s * motion.frequency_Hz)
    evaluated = slice(-round(periods / (motion.frequency_Hz * motion.period_s)), None)
    true = motion.amplitude_rad * pulsation * np.cos(phase[evaluated])
    rate = estimates(estimator, angle_rad)[evaluated]
    rms = math.sqrt(np.mean((rate - true[:, None]) ** 2))
    shares = np.exp(-1j * phase[evaluated])[:, None] * rate
    lags = [-np.angle(share.sum(axis=0)) / pulsation for share in np.array_split(shares, periods)]
    lag, deviation = np.mean(lags), np.std(lags, ddof=1) / math.sqrt(np.size(lags))
    acceleration = motion.amplitude_rad * pulsation**2 / math.sqrt(2)
    of_noise, of_lag = derived.noise_gain_1_s[0] * motion.noise_rad, derived.lag_s[0]
    return rms, float(lag), float(deviation), math.hypot(of_noise, of_lag * acceleration), of_lag
