"""Residuals of windows: their mean square in the noise, of each hinge, and over angle, rate and time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spheretwin.machine.state_estimation import HINGE_NAMES
from spheretwin.machine.windows import Part, Shooting
from spheretwin.models.base.arrays import Array

BINS = 6

CHI2 = (0.9, 1.1)
"""Mean square of all residuals over that of the noise, if the model lacks nothing."""


QUANTITIES = {"angle_rad": "angle, rad", "rate_rad_s": "rate, rad/s", "t_s": "time, s"}
"""Quantities by which residuals are sorted, and their labels."""


class ResidualBin(NamedTuple):
    """Residuals of one hinge in a range of its angle, of its rate, or of the time."""

    hinge: str
    by: str
    """One of `QUANTITIES`."""
    low: float
    high: float
    rows: int
    mean_rad: float
    """Measured minus computed."""
    rms_rad: float


class ResidualFit(NamedTuple):
    """Agreement of a machine with windows."""

    chi2: float
    """Mean square of the residuals in the noise of the sensors."""
    hinge_chi2: dict[str, float]
    """NaN for a hinge that is not informative: free starts explain whatever its sensor reports."""
    bins: tuple[ResidualBin, ...]


def fit_of(parts: Sequence[Part], shooting: Shooting) -> ResidualFit:
    """Return the agreement of windows under some parameters, which `Shooting.parts` gave."""
    windows = shooting.windows
    measured, deviation = (np.concatenate(column) for column in zip(*shooting.observed, strict=True))
    residual = np.concatenate([part.residual for part in parts])
    valid = np.isfinite(measured)
    # Of each hinge, less angle and rate of each free start.
    free = valid.sum(axis=0) - 2 * len(windows)
    hinge_chi2 = np.where(free > 0, np.sum(residual**2, axis=0) / np.maximum(free, 1), np.nan)
    residual_rad = np.where(valid, residual * deviation, np.nan)
    times = [window.log.t_s[window.first + 1 :][: window.rows, None] for window in windows]
    columns = (
        measured,
        np.concatenate([window.rate_rad_s for window in windows]),
        np.vstack(times) + [0.0] * 3,
    )
    return ResidualFit(
        sum(part.squares for part in parts) / sum(part.used for part in parts),
        dict(zip(HINGE_NAMES, map(float, hinge_chi2), strict=True)),
        tuple(
            one
            for hinge, name in enumerate(HINGE_NAMES)
            for by, values in zip(QUANTITIES, columns, strict=True)
            for one in _bins(name, by, values[valid[:, hinge], hinge], residual_rad[valid[:, hinge], hinge])
        ),
    )


def _bins(hinge: str, by: str, values: Array, residual_rad: Array) -> list[ResidualBin]:
    """Return the residuals of a hinge over some values."""
    if not len(values) or np.ptp(values) == 0:
        return []
    edges = np.linspace(values.min(), values.max(), BINS + 1)
    place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, BINS - 1)
    bins = []
    for number in np.unique(place):
        chosen = residual_rad[place == number]
        mean, rms = float(chosen.mean()), float(np.sqrt(np.mean(chosen**2)))
        low, high = float(edges[number]), float(edges[number + 1])
        bins.append(ResidualBin(hinge, by, low, high, len(chosen), mean, rms))
    return bins
