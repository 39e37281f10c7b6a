"""Ranges of plots of several runs, in which the settled runs can be read, and the values outside of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.viz.comparison.runs import ComparedRun
from spheretwin.viz.layout.extents import CLIPPED_FROM, MARGIN, USUAL, number
from spheretwin.viz.quantities import Quantity

Array = NDArray[np.float64]


class Outside(NamedTuple):
    """Values of one run outside of a range."""

    run: int
    """Number of the run, from 1."""
    value: float
    """The farthest."""
    from_s: float
    until_s: float

    def text(self) -> str:
        """Return run, value and times."""
        return f"run {self.run} reaches {number(self.value)} ({self.from_s:.3g} s to {self.until_s:.3g} s)"


class PlotRange(NamedTuple):
    """Range of a plot."""

    low: float
    high: float
    outside: tuple[Outside, ...]


def quantity_range(quantity: Quantity, runs: Sequence[ComparedRun], leading: Sequence[int]) -> PlotRange:
    """Return the range of a quantity: its own limits, or that of the settled runs and all references.

    Parameters
    ----------
    quantity : Quantity
    runs : sequence of ComparedRun
    leading : sequence of int
        Places of the runs that show the reference.
    """
    if quantity.limits:
        return PlotRange(*quantity.limits, ())
    desired = quantity.desired
    references = [desired(runs[place].rows) for place in leading] if desired else []
    return settled_range(runs, [quantity.column(run.rows) for run in runs], quantity.floor, references)


def settled_range(
    runs: Sequence[ComparedRun], of_runs: Sequence[Array], least: float, references: Sequence[Array] = ()
) -> PlotRange:
    """Return a range that contains every value, or the settled runs if that is much larger.

    A settled run is the second half and 85 % of the values of a complete run: a transient and a run that
    failed do not flatten the others. If no run is complete, it is 85 % of each.

    Parameters
    ----------
    runs : sequence of ComparedRun
    of_runs : sequence of (n,) arrays
        Values of each run; a number that is not finite is no value.
    least : float
        Half of the least range: smaller values must not look large.
    references : sequence of (n,) arrays
        Values that are always within the range.
    """
    finite = [np.where(np.isfinite(values), values, np.nan) for values in of_runs]
    complete = [
        values for run, values in zip(runs, finite, strict=True) if not run.early_end and _has_number(values)
    ]
    settled = [(_usual(values), values[len(values) // 2 :]) for values in complete] or [
        (_usual(values), values[:0]) for values in finite if _has_number(values)
    ]
    everything = _bounds([values for values in finite if _has_number(values)])
    usual = _bounds([*(np.concatenate(parts) for parts in settled), *references])
    span = max(usual[1] - usual[0], 2 * least)
    low, high = everything if everything[1] - everything[0] <= CLIPPED_FROM * span else usual
    middle, half = (low + high) / 2, max(least, MARGIN * (high - low) / 2)
    low, high = middle - half, middle + half
    outside = (
        _outside(place, run.table["t_s"], values, low, high)
        for place, (run, values) in enumerate(zip(runs, finite, strict=True), start=1)
    )
    return PlotRange(low, high, tuple(item for item in outside if item))


def _has_number(values: Array) -> bool:
    return not np.all(np.isnan(values))


def _usual(values: Array) -> Array:
    """Return the bounds of the shortest interval that contains 85 % of the values."""
    ordered = np.sort(values[~np.isnan(values)])
    count = math.ceil(USUAL * len(ordered))
    lowest, highest = ordered[: len(ordered) - count + 1], ordered[count - 1 :]
    place = int(np.argmin(highest - lowest))
    return np.array([lowest[place], highest[place]])


def _bounds(of_runs: Sequence[Array]) -> tuple[float, float]:
    """Return the bounds of all values; 0 if there is none."""
    if not of_runs:
        return 0.0, 0.0
    return min(float(np.nanmin(values)) for values in of_runs), max(
        float(np.nanmax(values)) for values in of_runs
    )


def _outside(place: int, t_s: Array, values: Array, low: float, high: float) -> Outside | None:
    rows = np.flatnonzero((values < low) | (values > high))
    if not len(rows):
        return None
    distance = np.maximum(values[rows] - high, low - values[rows])
    farthest = rows[int(np.argmax(distance))]
    return Outside(place, float(values[farthest]), float(t_s[rows[0]]), float(t_s[rows[-1]]))
