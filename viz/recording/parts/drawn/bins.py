"""Rows gathered into bins of time, whatever the chunks in which they come."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Binned(NamedTuple):
    """Bins that are complete."""

    t_s: Array
    """Time of the first row of each."""
    low: Array
    """Least value of each column: (bins, columns)."""
    high: Array
    """Greatest value."""
    first: Array
    """Value in the first row."""
    last: Array
    """Value in the last row."""
    mean: Array
    middle_s: Array
    """Time of the row amid each."""

    def extremes(self) -> Array:
        """Value of the largest magnitude of each column: what is seldom must not be lost."""
        return np.where(self.high >= -self.low, self.high, self.low)

    def pairs(self) -> tuple[Array, Array]:
        """Times and values of two rows a bin: its bounds, in the order in which the bin rises or falls."""
        rises = self.last >= self.first
        values = np.stack(
            [np.where(rises, self.low, self.high), np.where(rises, self.high, self.low)], axis=1
        )
        return np.stack([self.t_s, self.middle_s], axis=1).ravel(), values.reshape(-1, values.shape[2])


class Bins:
    """Gathers rows into bins of one width.

    Parameters
    ----------
    rate_Hz : float
        Bins a second.
    """

    def __init__(self, rate_Hz: float) -> None:
        self._rate_Hz = rate_Hz
        self._t_s: Array = np.empty(0)
        self._values: Array = np.empty((0, 0))

    def add(self, t_s: Array, values: Array) -> Binned | None:
        """Add rows (n, columns); returns what bins they have completed, if any."""
        if len(self._t_s):
            t_s, values = np.concatenate([self._t_s, t_s]), np.concatenate([self._values, values])
        # A tick that falls on the edge of a bin is in it, whatever its last bit.
        starts = np.flatnonzero(np.diff(np.floor(t_s * self._rate_Hz + 1e-6), prepend=-1.0))
        last = int(starts[-1])
        self._t_s, self._values = t_s[last:].copy(), values[last:].copy()
        return _binned(t_s[:last], values[:last], starts[:-1])

    def rest(self) -> Binned | None:
        """The last bin, which no row is added to any more."""
        return _binned(self._t_s, self._values, np.zeros(1, dtype=np.int64)) if len(self._t_s) else None


def _binned(t_s: Array, values: Array, starts: NDArray[np.int64]) -> Binned | None:
    if not len(t_s):
        return None
    ends = np.append(starts[1:], len(t_s))
    return Binned(
        t_s[starts],
        np.minimum.reduceat(values, starts, axis=0),
        np.maximum.reduceat(values, starts, axis=0),
        values[starts],
        values[ends - 1],
        np.add.reduceat(values, starts, axis=0) / (ends - starts)[:, None],
        t_s[(starts + ends) // 2],
    )
