"""Rows gathered into bins of time, whatever the chunks in which they come."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FIRST_S = 2.0
"""Time of the bins in the first chunk."""

MOST = 4096
"""Bins that a chunk need not exceed."""


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
    last_s: Array
    """Time of the last row of each."""

    def extremes(self) -> Array:
        """Value of the largest magnitude of each column: what is seldom must not be lost."""
        return np.where(self.high >= -self.low, self.high, self.low)

    def pairs(self) -> tuple[Array, Array]:
        """Times and values of two rows a bin: its bounds, in the order in which the bin rises or falls.

        They stand at its ends, so that what rises or falls steadily is drawn as it is.
        """
        rises = self.last >= self.first
        values = np.stack(
            [np.where(rises, self.low, self.high), np.where(rises, self.high, self.low)], axis=1
        )
        return np.stack([self.t_s, self.last_s], axis=1).ravel(), values.reshape(-1, values.shape[2])


class Bins:
    """Gathers rows into bins of one width, and bins into chunks.

    A file has some bytes for every chunk of every entity. Chunks therefore grow with what was handed over
    before them; what a killed process has not handed over is less than half of that, or two seconds.

    Parameters
    ----------
    rate_Hz : float
        Bins a second.
    at_once : bool
        Hand over every bin once it is complete.
    """

    def __init__(self, rate_Hz: float, *, at_once: bool = False) -> None:
        self._rate_Hz, self._at_once = rate_Hz, at_once
        self._t_s: Array = np.empty(0)
        self._values: Array = np.empty((0, 0))
        self._held: list[Binned] = []
        self._handed_over = 0

    def add(self, t_s: Array, values: Array) -> Binned | None:
        """Add rows (n, columns); returns complete bins, once there are enough."""
        if len(self._t_s):
            t_s, values = np.concatenate([self._t_s, t_s]), np.concatenate([self._values, values])
        # A tick that falls on the edge of a bin is in it, whatever its last bit.
        starts = np.flatnonzero(np.diff(np.floor(t_s * self._rate_Hz + 1e-6), prepend=-1.0))
        last = int(starts[-1])
        self._t_s, self._values = t_s[last:].copy(), values[last:].copy()
        if last:
            self._held.append(_binned(t_s[:last], values[:last], starts[:-1]))
        due = 1 if self._at_once else max(FIRST_S * self._rate_Hz, min(self._handed_over // 2, MOST))
        return self._hand_over() if sum(len(each.t_s) for each in self._held) >= due else None

    def rest(self) -> Binned | None:
        """All that is left, with the last bin, which no row is added to any more."""
        if len(self._t_s):
            self._held.append(_binned(self._t_s, self._values, np.zeros(1, dtype=np.int64)))
            self._t_s = np.empty(0)
        return self._hand_over() if self._held else None

    def _hand_over(self) -> Binned:
        whole = Binned(*(np.concatenate(parts) for parts in zip(*self._held, strict=True)))
        self._held = []
        self._handed_over += len(whole.t_s)
        return whole


def _binned(t_s: Array, values: Array, starts: NDArray[np.int64]) -> Binned:
    ends = np.append(starts[1:], len(t_s))
    return Binned(
        t_s[starts],
        np.minimum.reduceat(values, starts, axis=0),
        np.maximum.reduceat(values, starts, axis=0),
        values[starts],
        values[ends - 1],
        np.add.reduceat(values, starts, axis=0) / (ends - starts)[:, None],
        t_s[ends - 1],
    )
