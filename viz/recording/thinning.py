"""Which rows of a run a recording keeps: every one, some for the eye, or some with all that stands out."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.table import Table
from spheretwin.viz.recording.parts.events import QUIET_S

Array = NDArray[np.float64]
Places = NDArray[np.intp]

# Rows of so long a time are looked at together for what stands out in them.
WINDOW_S = 20.0

# Rows whose bounds are found before the place of the bound is looked for in one such block: a bound takes a
# fourth of the time of its place.
_BLOCK = 64

# Of a bin or a window: times are products of whole numbers, right to some 1e-16 of themselves.
_ROUNDING = 1e-6


class Thinning:
    """Keeps every row."""

    def take(self, rows: Table) -> list[Table]:
        """Rows to keep, as far as that is known after these."""
        return [rows]

    def rest(self) -> list[Table]:
        """Rows to keep of those that nothing was known of yet."""
        return []


class Firsts(Thinning):
    """Keeps the first row of each bin of time.

    Parameters
    ----------
    rate_Hz : float
        Bins a second.
    """

    def __init__(self, rate_Hz: float) -> None:
        self._rate_Hz = rate_Hz
        self._bin = -1

    def take(self, rows: Table) -> list[Table]:
        """Rows to keep."""
        kept = rows.values[self.firsts(rows["t_s"])]
        return [Table(rows.signals, kept)] if len(kept) else []

    def firsts(self, t_s: Array) -> Places:
        """Places of the next rows that are the first of their bins."""
        bins = np.floor(t_s * self._rate_Hz + _ROUNDING)
        new = np.flatnonzero(np.diff(bins, prepend=self._bin) > 0)
        self._bin = bins[-1]
        return new


class FirstsAndExtremes(Thinning):
    """Keeps whole rows, bit for bit: the first of each bin of time, and all that stand out.

    Those are, of every window of 20 s, the rows in which an entry of a signal is at its largest or smallest;
    where a state changes; where the current limit begins and ceases to cut the torque; and the last row.
    Windows go by time, and end besides where the columns change: how the rows come in chunks does not show.

    Parameters
    ----------
    rate_Hz : float
        Bins a second.
    """

    def __init__(self, rate_Hz: float) -> None:
        self._firsts = Firsts(rate_Hz)
        self._window = -1.0
        self._waiting: list[Table] = []
        self._states: dict[str, Array] = {}
        self._last_saturated_s = -np.inf

    def take(self, rows: Table) -> list[Table]:
        """Rows to keep of the windows that are over."""
        windows = np.floor(rows["t_s"] / WINDOW_S + _ROUNDING)
        begins = np.flatnonzero(np.diff(windows, prepend=self._window) > 0)
        kept = []
        if self._waiting and rows.signals != self._waiting[0].signals:
            kept += self.rest()
        for first, last in zip([0, *begins], [*begins, len(rows)], strict=True):
            if last > first:
                self._waiting.append(rows.rows(first, last))
            if last < len(rows):
                kept += self.rest()
        self._window = windows[-1]
        return kept

    def rest(self) -> list[Table]:
        """Rows to keep of the window at hand, which ends here."""
        if not self._waiting:
            return []
        rows = Table(self._waiting[0].signals, np.concatenate([waiting.values for waiting in self._waiting]))
        self._waiting = []
        places = np.concatenate(
            [
                self._firsts.firsts(rows["t_s"]),
                _places_of(np.max, np.argmax, rows.values),
                _places_of(np.min, np.argmin, rows.values),
                self._changes_of_state(rows),
                self._saturation(rows),
                [len(rows) - 1],
            ]
        )
        return [Table(rows.signals, rows.values[np.unique(places.astype(np.intp))])]

    def _changes_of_state(self, rows: Table) -> Places:
        """Places of the first rows in which a part has another state."""
        changed = [np.empty(0, np.intp)]
        for signal in rows.signals:
            if signal.states:
                values = rows[signal.name].reshape(len(rows), -1)
                before = self._states.get(signal.name, values[0])
                changed.append(
                    np.flatnonzero((np.diff(values, axis=0, prepend=before[None]) != 0).any(axis=1))
                )
                self._states[signal.name] = values[-1].copy()
        return np.concatenate(changed)

    def _saturation(self, rows: Table) -> Places:
        """Places of the first and the last row of each saturation; short pauses are part of one."""
        places = np.flatnonzero(rows["allocation_scale"] < 1)
        if not len(places):
            return places
        t_s = rows["t_s"][places]
        begins = np.diff(t_s, prepend=self._last_saturated_s) > QUIET_S
        ends = np.diff(t_s, append=np.inf) > QUIET_S
        self._last_saturated_s = t_s[-1]
        return places[begins | ends]


def _places_of(bound: Callable[..., Array], place: Callable[..., Places], values: Array) -> Places:
    """Place of the first bound of each column, as ``place(values, axis=0)`` finds it."""
    ends = len(values) // _BLOCK * _BLOCK
    bounds = bound(values[:ends].reshape(-1, _BLOCK, values.shape[1]), axis=1)
    if ends < len(values):
        bounds = np.concatenate([bounds, bound(values[ends:], axis=0, keepdims=True)])
    starts = _BLOCK * place(bounds, axis=0)
    within = [place(values[start : start + _BLOCK, column]) for column, start in enumerate(starts)]
    return np.asarray(starts + within)
