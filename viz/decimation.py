"""Decimation: many rows as few numbers that keep the extremes."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry.fault_log import ColumnChanges
from spheretwin.models.telemetry.status import QUIET_S
from spheretwin.models.telemetry.table import Table


class Envelope(NamedTuple):
    """Bounds and means of a column over bins of rows; NaN for a bin without a number."""

    starts: NDArray[np.int64]
    """First row of each bin; bins have equal sizes, except the last."""
    low: Array
    high: Array
    mean: Array


def envelope(values: Array, most: int) -> Envelope:
    """Reduce a column to at most `most` bins.

    Parameters
    ----------
    values : (n,) array
        A NaN is no value.
    most : int
        Largest number of bins.
    """
    starts = np.arange(0, len(values), -(-len(values) // most))
    is_number = ~np.isnan(values)
    count = np.add.reduceat(is_number, starts, dtype=np.int64)
    total = np.add.reduceat(np.where(is_number, values, 0.0), starts)
    mean = np.divide(total, count, out=np.full(len(starts), np.nan), where=count > 0)
    return Envelope(starts, np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts), mean)


class Cells(NamedTuple):
    """Means and standard deviations of columns over cells of rows."""

    starts: NDArray[np.int64]
    """First row of each cell; cells have equal sizes, except the last."""
    mean: Array
    deviation: Array


def mean_and_deviation(values: Array, most: int) -> Cells:
    """Reduce columns (n, k) to at most `most` cells (m, k)."""
    starts = np.arange(0, len(values), -(-len(values) // most))
    sizes = np.diff(starts, append=len(values))[:, None]
    mean = np.add.reduceat(values, starts, axis=0) / sizes
    residual = values - np.repeat(mean, sizes[:, 0], axis=0)
    return Cells(starts, mean, np.sqrt(np.add.reduceat(residual**2, starts, axis=0) / sizes))


def octave_maxima(frequency: Array, values: Array, lines_per_octave: int) -> tuple[Array, Array]:
    """Reduce a spectrum to the highest line of each part of an octave.

    Parameters
    ----------
    frequency : (n,) array
        Above zero, rising.
    values : (n,) array
    each : int
        Lines for each octave.
    """
    if not len(frequency):
        return frequency, values
    part = np.floor(lines_per_octave * np.log2(frequency / frequency[0])).astype(np.int64)
    starts = np.flatnonzero(np.diff(part, prepend=part[0] - 1))
    ends = np.append(starts[1:], len(values))
    rows = [first + int(np.argmax(values[first:last])) for first, last in zip(starts, ends, strict=True)]
    return frequency[rows], values[rows]


Places = NDArray[np.intp]

# Time of the windows of which the extremes are kept.
WINDOW_S = 20.0

# Rows of a block: first the bounds of all blocks are found, then the place of the bound within one block. A
# bound takes a fourth of the time of its place.
_BLOCK = 64

# Tolerance at the edges of bins and windows: times are products of whole numbers, with errors of some 1e-16.
_ROUNDING = 1e-6


class RowSelection:
    """Selects every row."""

    def add(self, rows: Table) -> list[Table]:
        """Add rows; return the selected rows that are decided now."""
        return [rows]

    def flush(self) -> list[Table]:
        """Return the selected rows among those that were not decided yet."""
        return []


class FirstRows(RowSelection):
    """Selects the first row of each bin of time.

    Parameters
    ----------
    rate_Hz : float
        Bins a second.
    """

    def __init__(self, rate_Hz: float) -> None:
        self._rate_Hz = rate_Hz
        self._bin = -1

    def add(self, rows: Table) -> list[Table]:
        """Add rows; return the selected ones."""
        selected = rows.values[self.first_places(rows["t_s"])]
        return [Table(rows.signals, selected)] if len(selected) else []

    def first_places(self, t_s: Array) -> Places:
        """Return the places of the next rows that are the first of their bins."""
        bins = np.floor(t_s * self._rate_Hz + _ROUNDING)
        new = np.flatnonzero(np.diff(bins, prepend=self._bin) > 0)
        self._bin = bins[-1]
        return new


class FirstAndExtremeRows(RowSelection):
    """Selects whole rows, bit for bit: the first of each bin of time, and all extremes.

    Extremes are, in each window of 20 s, rows in which an entry of a signal is at its largest or smallest;
    where a state changes; where the current limit begins and ceases to cut the torque; and the last row.
    Windows depend on time, and also end where the columns change: the result does not depend on the chunks.

    Parameters
    ----------
    rate_Hz : float
        Bins a second.
    """

    def __init__(self, rate_Hz: float) -> None:
        self._firsts = FirstRows(rate_Hz)
        self._window = -1.0
        self._waiting: list[Table] = []
        self._changes = ColumnChanges()
        self._last_saturated_s = -np.inf

    def add(self, rows: Table) -> list[Table]:
        """Add rows; return the selected rows of the windows that have ended."""
        windows = np.floor(rows["t_s"] / WINDOW_S + _ROUNDING)
        begins = np.flatnonzero(np.diff(windows, prepend=self._window) > 0)
        selected = []
        if self._waiting and rows.signals != self._waiting[0].signals:
            selected += self.flush()
        for first, last in zip([0, *begins], [*begins, len(rows)], strict=True):
            if last > first:
                self._waiting.append(rows.rows(first, last))
            if last < len(rows):
                selected += self.flush()
        self._window = windows[-1]
        return selected

    def flush(self) -> list[Table]:
        """Return the selected rows of the present window, which ends here."""
        if not self._waiting:
            return []
        rows = Table(self._waiting[0].signals, np.concatenate([waiting.values for waiting in self._waiting]))
        self._waiting = []
        places = np.concatenate(
            [
                self._firsts.first_places(rows["t_s"]),
                _first_bounds(np.max, np.argmax, rows.values),
                _first_bounds(np.min, np.argmin, rows.values),
                self._state_changes(rows),
                self._saturation_ends(rows),
                [len(rows) - 1],
            ]
        )
        return [Table(rows.signals, rows.values[np.unique(places.astype(np.intp))])]

    def _state_changes(self, rows: Table) -> Places:
        """Return the places of the first rows in which a part has another state."""
        states = [signal.name for signal in rows.signals if signal.states]
        return np.array([tick for name in states for tick, *_ in self._changes.of(rows, name)], np.intp)

    def _saturation_ends(self, rows: Table) -> Places:
        """Return the places of the first and last row of each saturation; short pauses belong to it."""
        places = np.flatnonzero(rows["allocation_scale"] < 1)
        if not len(places):
            return places
        t_s = rows["t_s"][places]
        begins = np.diff(t_s, prepend=self._last_saturated_s) > QUIET_S
        ends = np.diff(t_s, append=np.inf) > QUIET_S
        self._last_saturated_s = t_s[-1]
        return places[begins | ends]


def _first_bounds(bound: Callable[..., Array], place: Callable[..., Places], values: Array) -> Places:
    """Return the place of the first bound of each column: that of ``place(values, axis=0)``."""
    ends = len(values) // _BLOCK * _BLOCK
    bounds = bound(values[:ends].reshape(-1, _BLOCK, values.shape[1]), axis=1)
    if ends < len(values):
        bounds = np.concatenate([bounds, bound(values[ends:], axis=0, keepdims=True)])
    starts = _BLOCK * place(bounds, axis=0)
    within = [place(values[start : start + _BLOCK, column]) for column, start in enumerate(starts)]
    return np.asarray(starts + within)


FIRST_CHUNK_S = 2.0
"""Time of the bins in the first chunk."""

MOST_BINS = 500
"""Bins after which a chunk is always sent: 20 s of 25 bins a second."""


class CompletedBins(NamedTuple):
    """Completed bins."""

    t_s: Array
    """Time of the first row of each."""
    low: Array
    """Least value of each column: (bins, columns)."""
    high: Array
    """Greatest value."""
    mean: Array
    last_s: Array
    """Time of the last row of each."""


class TimeBins:
    """Accumulates rows in bins of one width, and bins in chunks.

    A file needs some bytes for every chunk of every entity. Chunks therefore grow with what was sent
    before them; a killed process loses less than half of that, or two seconds.

    Parameters
    ----------
    rate_Hz : float
        Bins a second.
    at_once : bool
        Send every bin once it is complete.
    """

    def __init__(self, rate_Hz: float, *, immediate: bool = False) -> None:
        self._rate_Hz, self._at_once = rate_Hz, immediate
        self._t_s: Array = np.empty(0)
        self._values: Array = np.empty((0, 0))
        self._completed: list[CompletedBins] = []
        self._sent_count = 0

    def add(self, t_s: Array, values: Array) -> CompletedBins | None:
        """Add rows (n, columns); return completed bins, once there are enough."""
        if len(self._t_s):
            t_s, values = np.concatenate([self._t_s, t_s]), np.concatenate([self._values, values])
        # A tick on the edge of a bin is in that bin, for any rounding.
        starts = np.flatnonzero(np.diff(np.floor(t_s * self._rate_Hz + 1e-6), prepend=-1.0))
        last = int(starts[-1])
        self._t_s, self._values = t_s[last:].copy(), values[last:].copy()
        if last:
            self._completed.append(_reduce_bins(t_s[:last], values[:last], starts[:-1]))
        due = (
            1 if self._at_once else max(FIRST_CHUNK_S * self._rate_Hz, min(self._sent_count // 2, MOST_BINS))
        )
        return self._send() if sum(len(bins.t_s) for bins in self._completed) >= due else None

    def flush(self) -> CompletedBins | None:
        """Return the remaining bins with the last one, which receives no more rows."""
        if len(self._t_s):
            self._completed.append(_reduce_bins(self._t_s, self._values, np.zeros(1, dtype=np.int64)))
            self._t_s = np.empty(0)
        return self._send() if self._completed else None

    def _send(self) -> CompletedBins:
        bins = CompletedBins(*(np.concatenate(parts) for parts in zip(*self._completed, strict=True)))
        self._completed = []
        self._sent_count += len(bins.t_s)
        return bins


def _reduce_bins(t_s: Array, values: Array, starts: NDArray[np.int64]) -> CompletedBins:
    ends = np.append(starts[1:], len(t_s))
    return CompletedBins(
        t_s[starts],
        np.minimum.reduceat(values, starts, axis=0),
        np.maximum.reduceat(values, starts, axis=0),
        np.add.reduceat(values, starts, axis=0) / (ends - starts)[:, None],
        t_s[ends - 1],
    )
