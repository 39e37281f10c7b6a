"""Rows of a log: sorted by time, those of one time merged, and all at the times of the angles.

Angles and currents may come from two topics with stamps of their own. Verbs that cut a log into windows need
one row for each sample of the angles.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from spheretwin.machine.log import COMMANDED, Log
from spheretwin.models.base.arrays import Array, Booleans, Integers

GAP_PERIODS = 2.5
"""Periods of a stream from which an interval is a gap."""

OWN_STAMPS = "currents at times of their own, as means at the times of the angles"
"""Note of a log whose currents had other stamps than the angles."""

_SHORT, _MISSING = 0.7, 1.5  # periods: of a row between others, and where an angle is missing
_COUNTED = 0.5  # share of equal successive angles from which a sensor counts: it is held, not interpolated
_MOST_MISSING = 1000  # periods of the angles in which rows without them are inserted
_MANY_FALLS = 0.05  # of the rows
_UNEVEN, _MOST_UNEVEN = 0.2, 0.1  # departure of a step from the period; share of such steps in a table
_MOST_SHORT = 0.01  # of the rows, more after sorting than before


def row_order(t_s: Array, angles: Array, currents: Array) -> tuple[Integers, tuple[str, ...]]:
    """Return the rows of a file in the order of time, and a note if it is another one.

    The order stays if sorting would leave more gaps or short intervals in the angles or the currents: then a
    clock was set back, which the check of the log reports.
    """
    rows = np.arange(len(t_s))
    if np.all(np.diff(t_s[np.isfinite(t_s)]) >= 0):
        return rows, ()
    order = np.argsort(t_s, kind="stable")
    moved = 0
    for values in (angles, currents):
        place = np.isfinite(t_s) & np.any(np.isfinite(values), axis=1)
        before, after = t_s[place], t_s[order][place[order]]
        moved += int(np.count_nonzero(np.diff(before) < 0))
        period_s = _period_s(before, after)
        (short, gaps), (short_before, gaps_before) = (_count_faults(one, period_s) for one in (after, before))
        if short > short_before + _MOST_SHORT * len(before) or gaps > gaps_before:
            return rows, ()
    return order, (f"{moved} rows sorted by time" if moved else "rows of two topics sorted by time",)


def _period_s(before: Array, after: Array) -> float:
    """Return the median interval of times, of the sorted ones if they fall often."""
    steps = np.diff(before)
    steps = np.diff(after) if np.count_nonzero(steps < 0) > _MANY_FALLS * len(before) else steps
    return float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0


def _count_faults(t_s: Array, period_s: float) -> tuple[int, int]:
    """Return the numbers of short intervals, 0 included, and of gaps."""
    steps = np.diff(t_s)
    short = np.count_nonzero((steps >= 0) & (steps < _SHORT * period_s))
    return int(short), int(np.count_nonzero(steps > GAP_PERIODS * period_s))


def align_rows(log: Log) -> Log:
    """Return a log with one row for each sample of the angles, in the order of time.

    Rows of one time that complete each other are merged. Rows between those of the angles are left out: their
    currents count in the mean over the interval of a row if they were commanded, about its time if they were
    measured. Where the currents have a gap they are NaN.
    """
    order, notes = row_order(log.t_s, log.angle_rad, log.current_A)
    if notes:
        columns = {name: getattr(log, name)[order] for name in ("t_s", "angle_rad", "current_A")}
        log = replace(log, **columns, notes=(*log.notes, *notes))
    log = _merge_sensors(_merge_rows(log))
    has_angles, has_currents = (
        np.asarray(np.any(np.isfinite(values), axis=1)) for values in (log.angle_rad, log.current_A)
    )
    angle_s = log.t_s[has_angles]
    if len(angle_s) < 2 or not np.all(np.diff(log.t_s) > 0) or _is_table(log.t_s, has_angles, has_currents):
        return log
    period_s = float(np.median(np.diff(angle_s)))
    is_between = ~has_angles & (_distance_s(log.t_s, angle_s) < _MISSING * period_s)
    if not np.any(is_between):
        return log
    if not np.any(is_between & has_currents):
        rows = ~is_between
        return replace(log, t_s=log.t_s[rows], current_A=log.current_A[rows], angle_rad=log.angle_rad[rows])
    # Where angles are missing, rows without them at the times of the missing ones.
    steps = np.diff(angle_s)
    counts = np.where(steps < _MOST_MISSING * period_s, np.maximum(np.rint(steps / period_s), 1), 1).astype(
        int
    )
    places = np.repeat(np.arange(len(steps)), counts)
    parts = np.arange(len(places)) - np.repeat(np.cumsum(counts) - counts, counts)
    t_s = np.append(angle_s[places] + steps[places] * (parts / counts[places]), angle_s[-1])
    is_measured = np.append(parts == 0, True)
    angle_rad = np.full((len(t_s), 3), np.nan)
    angle_rad[is_measured] = log.angle_rad[has_angles]
    ends = t_s + np.minimum(np.diff(t_s, append=t_s[-1] + period_s), GAP_PERIODS * period_s)
    held = log.currents == COMMANDED
    early_s = 0.0 if held else 0.5 * (ends - t_s)
    current_A = _interval_means(log.t_s, log.current_A, t_s - early_s, ends - early_s, held=held)
    notes = (*log.notes, OWN_STAMPS)
    return replace(log, t_s=t_s, current_A=current_A, angle_rad=angle_rad, notes=notes)


def _is_table(t_s: Array, has_angles: Booleans, has_currents: Booleans) -> bool:
    """True for even rows that mostly have angles and currents together: a missing one is a lost sample."""
    steps = np.diff(t_s)
    even = np.mean(np.abs(steps / np.median(steps) - 1) < _UNEVEN)
    return bool(even > 1 - _MOST_UNEVEN and np.mean(has_currents[has_angles]) > 0.5)


def _distance_s(t_s: Array, angle_s: Array) -> Array:
    """Return the distance of the angles around each time; outside of all, twice that to the next."""
    place = np.clip(np.searchsorted(angle_s, t_s), 1, len(angle_s) - 1)
    outside_s = np.maximum(np.maximum(angle_s[0] - t_s, t_s - angle_s[-1]), 0.0)
    return np.where(outside_s > 0, 2 * outside_s, angle_s[place] - angle_s[place - 1])


def _merge_sensors(log: Log) -> Log:
    """Return a log with the angles at the times of that with most rows, if others have other times."""
    known = np.isfinite(log.angle_rad)
    reference = known[:, int(np.argmax(known.sum(axis=0)))]
    others = [i for i in range(3) if np.count_nonzero(known[:, i] & reference) < 0.5 * known[:, i].sum()]
    if not others or not np.all(np.diff(log.t_s) > 0):
        return log
    angle_rad = np.where(reference[:, None], log.angle_rad, np.nan)
    for i in others:
        at, values = log.t_s[known[:, i]], log.angle_rad[known[:, i], i]
        after = np.clip(np.searchsorted(at, log.t_s), 1, len(at) - 1)
        counts = np.mean(np.diff(values) == 0) > _COUNTED
        interpolated = values[after - 1] if counts else np.interp(log.t_s, at, values)
        is_gap = at[after] - at[after - 1] > GAP_PERIODS * np.median(np.diff(at))
        is_known = reference & ~is_gap & (log.t_s >= at[0]) & (log.t_s <= at[-1])
        angle_rad[:, i] = np.where(is_known, interpolated, np.nan)
    note = "angles at times of their own, interpolated to those of the most frequent one"
    return replace(log, angle_rad=angle_rad, notes=(*log.notes, note))


def _interval_means(sample_s: Array, samples: Array, starts: Array, ends: Array, *, held: bool) -> Array:
    """Return the means of samples over intervals, held or interpolated; NaN in a gap."""
    columns = []
    for column in samples.T:
        known = np.isfinite(column)
        at, values = sample_s[known], column[known]
        if len(at) < 2:
            columns.append(np.full(len(starts), np.nan))
            continue
        steps = np.diff(at)
        longest_s = GAP_PERIODS * float(np.median(steps))
        at = np.concatenate([[at[0] - longest_s], at, [at[-1] + longest_s]])
        values = np.concatenate([values[:1], values, values[-1:]])
        means = Integral(at, values[:, None], held).mean(starts, ends)[:, 0]
        after = np.clip(np.searchsorted(at, starts, side="right"), 1, len(at) - 1)
        is_gap = (at[after] - at[after - 1] > longest_s * (1 + 1e-9)) | (starts < at[0]) | (ends > at[-1])
        columns.append(np.where(is_gap, np.nan, means))
    return np.stack(columns, axis=1)


class Integral:
    """Integral of samples over time, from which the mean of any interval follows."""

    def __init__(self, t_s: Array, values: Array, zero_order_hold: bool) -> None:
        steps = np.diff(t_s)[:, None] * (values[:-1] if zero_order_hold else (values[1:] + values[:-1]) / 2)
        self._t_s = t_s
        # A row for each column: `interp` copies what is not contiguous.
        self._integral = np.zeros((values.shape[1], len(t_s)))
        np.cumsum(steps.T, axis=1, out=self._integral[:, 1:])

    def mean(self, starts: Array, ends: Array) -> Array:
        """Return the mean of each column in each interval; outside the samples they are zero."""
        columns = [
            np.interp(ends, self._t_s, column) - np.interp(starts, self._t_s, column)
            for column in self._integral
        ]
        return np.stack(columns, axis=1) / (ends - starts)[:, None]


def _merge_rows(log: Log) -> Log:
    """Return a log whose rows of one time are one, if no number of them differs."""
    steps = np.diff(log.t_s)
    if not np.any(steps == 0):
        return log
    values = np.concatenate([log.angle_rad, log.current_A], axis=1)
    starts = np.concatenate([[0], np.flatnonzero(steps != 0) + 1])
    low, high = np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)
    agrees = np.all((low == high) | np.isnan(low), axis=1)
    rows = np.repeat(agrees, np.diff(starts, append=len(log)))
    rows[starts] = False  # the first row of a time stays, as do all that differ
    values[starts[agrees]] = low[agrees]
    hinges = log.angle_rad.shape[1]
    return replace(
        log,
        t_s=log.t_s[~rows],
        angle_rad=values[~rows, :hinges],
        current_A=values[~rows, hinges:],
    )
