"""The strongest oscillations of a column: frequency and amplitude of each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PEAKS = 3
FEWEST_ROWS = 16

# The window spreads an oscillation over three lines: weaker ones beside it are its own slopes.
_APART = 2


class Peak(NamedTuple):
    """An oscillation."""

    frequency_Hz: float
    amplitude: float
    """In the unit of the column."""


def peaks(values: Array, period_s: float) -> list[Peak]:
    """Strongest oscillations about the mean, the strongest first, at most three.

    Hann's window; frequency and amplitude between the lines of the spectrum from the two that a peak stands
    on, exact for an oscillation that is alone.

    Parameters
    ----------
    values : (n,) array
        A column, without gaps.
    period_s : float
        Time between rows, s.
    """
    n = len(values)
    if n < FEWEST_ROWS or not np.all(np.isfinite(values)):
        return []
    lines = _lines(values)
    inner = np.arange(_APART, len(lines) - 1)
    tops = inner[(lines[inner] > lines[inner - 1]) & (lines[inner] >= lines[inner + 1])]
    strongest = tops[np.argsort(-lines[tops], kind="stable")][:PEAKS]
    return [_between(lines, int(top), n, period_s) for top in strongest]


def amplitudes(values: Array, period_s: float) -> tuple[Array, Array]:
    """Frequencies above zero, Hz, and the amplitude at each of the oscillation that it would be alone.

    Parameters
    ----------
    values : (n,) array
        A column; one with gaps, or too short, has no spectrum.
    period_s : float
        Time between rows, s.
    """
    n = len(values)
    if n < FEWEST_ROWS or not np.all(np.isfinite(values)):
        return np.empty(0), np.empty(0)
    lines = _lines(values)
    return np.arange(1, len(lines)) / (n * period_s), 4 * lines[1:] / n


def _lines(values: Array) -> Array:
    """Of the column about its mean, under Hann's window."""
    n = len(values)
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n)
    return np.abs(np.fft.rfft((values - values.mean()) * window))


def _between(lines: Array, top: int, rows: int, period_s: float) -> Peak:
    """The oscillation that has its highest line at `top`: under Hann's window neighbours tell how far off."""
    side = 1 if lines[top + 1] > lines[top - 1] else -1
    ratio = lines[top + side] / lines[top]
    off = (2 * ratio - 1) / (ratio + 1)  # of a line's distance, to that side
    left = np.sinc(off) / (1 - off * off)  # of the amplitude, at the line
    return Peak(float((top + side * off) / (rows * period_s)), float(4 * lines[top] / (rows * left)))
