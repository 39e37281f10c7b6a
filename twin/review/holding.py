"""A run held against a reference: where it first leaves what the tolerances allow."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.wording import did_you_mean
from spheretwin.models.telemetry.signals import Signal
from spheretwin.twin.review.run import Reviewed
from spheretwin.twin.review.tolerances import Tolerance, Tolerances

Array = NDArray[np.float64]

# A time in whole ticks is so to rounding only.
WHOLE = 1e-9


class Exceeded(NamedTuple):
    """Where a signal first leaves what it is allowed."""

    path: str
    signal: str
    axis: str
    """Label of the entry; empty for a signal of one number."""
    t_s: float
    by: float
    """Beyond the tolerance, in the unit of the signal; no number where one of the two has no value."""


def exceeded(reference: Reviewed, run: Reviewed, tolerances: Tolerances) -> list[Exceeded]:
    """First place of each signal that leaves its tolerance, the earliest first.

    A value is allowed within ``absolute + relative · |reference|`` of what the reference has at that time,
    or anywhere between its lowest and highest within ``time_s`` of it. Where one of the two has ended and the
    other goes on, no signal is within any tolerance.

    Raises
    ------
    InputError
        One of the runs lacks a signal, or they have different control periods.
    """
    if run.period_s != reference.period_s:
        raise InputError(
            f"review {run.path}: expected a control period of {reference.period_s!r} s as the reference has,"
            f" received {run.period_s!r} s"
        )
    found = []
    for name, tolerance in tolerances.signals.items():
        signal, other = _signal(reference, name), _signal(run, name)
        if signal.size != other.size:
            raise InputError(
                f"review {run.path}: expected {name} of {signal.size} numbers, received {other.size}"
            )
        if place := _first(*_both(reference, run, name), tolerance, reference.period_s):
            tick, entry, by = place
            axis = signal.labels[entry] if signal.labels else ""
            found.append(Exceeded(str(run.path), name, axis, tick * run.period_s, by))
    return sorted(found, key=lambda each: each.t_s)


def beyond(reference: Array, values: Array, tolerance: Tolerance, period_s: float) -> Array:
    """How far values are beyond what a reference allows, (n, k): 0 within, infinite where one has no value.

    Parameters
    ----------
    reference, values : (n, k) array
        At the same ticks; a NaN is no value.
    tolerance : Tolerance
        What is allowed.
    period_s : float
        Time between rows, s.
    """
    allowed = tolerance.absolute + tolerance.relative * np.abs(reference)
    ticks = min(int(tolerance.time_s / period_s + WHOLE), len(reference))
    none = np.isnan(reference)
    highest, lowest = (
        np.where(none, -np.inf, reference + allowed),
        np.where(none, np.inf, reference - allowed),
    )
    if ticks:
        from scipy.ndimage import maximum_filter1d, minimum_filter1d  # slow to import

        window = 2 * ticks + 1
        highest = maximum_filter1d(highest, window, axis=0, mode="nearest")
        lowest = minimum_filter1d(lowest, window, axis=0, mode="nearest")
    with np.errstate(invalid="ignore"):  # infinite from infinite, where a run has diverged
        over = np.maximum(np.maximum(values - highest, lowest - values), 0.0)
    return np.where(none & np.isnan(values), 0.0, np.where(np.isnan(over), np.inf, over))


def _first(
    reference: Array, values: Array, tolerance: Tolerance, period_s: float
) -> tuple[int, int, float] | None:
    """Tick, entry and amount of the first that is beyond, of those of its tick the farthest."""
    rows = min(len(reference), len(values))
    over = beyond(reference[:rows], values[:rows], tolerance, period_s)
    if len(ticks := np.flatnonzero(over.any(axis=1))):
        entry = int(np.argmax(over[ticks[0]]))
        return int(ticks[0]), entry, float(over[ticks[0], entry])
    return None if len(reference) == len(values) else (rows, 0, np.inf)


def _both(reference: Reviewed, run: Reviewed, name: str) -> tuple[Array, Array]:
    of_reference, of_run = (
        each.every_tick[name].reshape(len(each.every_tick), -1) for each in (reference, run)
    )
    return of_reference, of_run


def _signal(run: Reviewed, name: str) -> Signal:
    signals = {signal.name: signal for signal in run.table.signals}
    if name in signals:
        return signals[name]
    raise InputError(
        f"tolerance: expected signals of {run.path}, received {name}{did_you_mean(name, signals)}"
        f" (it has {', '.join(signals)})"
    )
