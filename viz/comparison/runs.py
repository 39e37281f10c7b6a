"""Runs of a comparison: their data, references, spectra, and the ranges of their plots."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry.status import Level
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.layout.extents import CLIPPED_FROM, MARGIN, USUAL, number
from spheretwin.viz.quantities import Quantity, QuantityRows

Event = tuple[float, Level, str]
"""Simulated time in s, level, text."""


class LawTrajectory(NamedTuple):
    """Trajectory of one run under a law."""

    law: str
    t_s: NDArray[np.float64]  # (n,)
    q_rad: NDArray[np.float64]  # (n, 3)
    q_ref_rad: NDArray[np.float64]  # (n, 3)
    torque_Nm: NDArray[np.float64]  # (n,) norm


class EarlyEnd(NamedTuple):
    """End of a run that is not complete."""

    t_s: float
    status: str
    reason: str


class ComparedRun(NamedTuple):
    """Run of a comparison."""

    name: str
    """Unique short name: ``run_1_nutation``."""
    label: str
    """Text of a legend: file, law, and the differing fields."""
    law: str
    period_s: float
    """Period of the rows."""
    rows: QuantityRows
    """Telemetry with at least one row, and the parameters of derived quantities."""
    record: Mapping[str, str]
    """Metadata of its telemetry file."""
    events: Sequence[Event]
    early_end: EarlyEnd | None = None
    errors: str = ""
    """Its largest and RMS error, for a legend."""

    @property
    def table(self) -> Table:
        """Its telemetry."""
        return self.rows.table

    @property
    def legend(self) -> str:
        """Label, and how a run that is not complete ended."""
        end = self.early_end
        return f"{self.label}; {end.status} at {end.t_s:.3g} s" if end else self.label


# Times of ticks at different rates are products that differ in their last bits, and angles with them.
SAME_rad = 1e-9


def leaders(tables: Sequence[Table]) -> list[int]:
    """Places of the runs that show each desired motion longest, in order.

    Parameters
    ----------
    tables : sequence of Table
        With a row each at least.
    """
    leading: list[int] = []
    for place in sorted(range(len(tables)), key=lambda place: -float(tables[place]["t_s"][-1])):
        if not any(_same(tables[place], tables[leader]) for leader in leading):
            leading.append(place)
    return sorted(leading)


def common_rows(one: Table, other: Table) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the places of the rows of both runs at their common ticks."""
    t_ns, others_ns = (np.round(table["t_s"] * 1e9).astype(np.int64) for table in (one, other))
    _, rows, others = np.intersect1d(t_ns, others_ns, assume_unique=True, return_indices=True)
    return rows, others


def _same(one: Table, other: Table) -> bool:
    """True if two runs have the same reference at all common ticks."""
    rows, others = common_rows(one, other)
    apart = np.abs(one["q_ref_rad"][rows] - other["q_ref_rad"][others])
    return bool(apart.max(initial=0.0) <= SAME_rad)


class Spectrum(NamedTuple):
    """Spectrum of one run's tracking error about one hinge."""

    frequency_Hz: Array  # (n,) above zero
    amplitude_mrad: Array  # (n,)
    peaks: Sequence[tuple[float, float]]
    """Frequency in Hz and amplitude in mrad of the strongest."""


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

    def outside_lines(self) -> list[str]:
        """Return lines that state the values outside, two runs on each; none if all values are within."""
        texts = [item.text() for item in self.outside]
        if not texts:
            return []
        lines = [", ".join(texts[first : first + 2]) for first in range(0, len(texts), 2)]
        return ("outside of the axis: " + ",\n".join(lines)).splitlines()


DECADES = 6
"""Decades of a logarithmic axis at most: smaller errors are rounding errors."""


class LogarithmicRange(NamedTuple):
    """Range of a plot with a logarithmic axis."""

    low: float
    high: float
    is_cut: bool
    """True if values are below the axis."""

    def outside_lines(self) -> list[str]:
        """Return the line that states that values are below the axis; none if all are within."""
        return [f"values below {self.low:.1g} are below the axis"] if self.is_cut else []


def logarithmic_range(of_runs: Sequence[Array]) -> LogarithmicRange:
    """Return the range of all positive values, at most `DECADES`.

    Parameters
    ----------
    of_runs : sequence of arrays
        Values of each run.
    """
    values = np.concatenate([*map(np.ravel, of_runs), [np.nan]])
    values = values[np.isfinite(values) & (values > 0)]
    if not len(values):
        return LogarithmicRange(0.1, 1.0, is_cut=False)
    high, least = 1.5 * float(values.max()), float(values.min())
    low = max(least / 1.5, high / 10**DECADES)
    return LogarithmicRange(low, high, least < low)


LINKED = ("error", "angle", "sliding")
"""Groups of sibling quantities: their plots have one range, so that magnitudes can be compared."""

OUTLIER, OFF_REFERENCE = 20.0, 3.0
"""A run is outside of the range if its settled values are so many times larger than those of the next one, or
than the reference."""


def quantity_ranges(
    quantities: Sequence[Quantity], runs: Sequence[ComparedRun], leading: Sequence[int]
) -> list[PlotRange]:
    """Return the range of each quantity: its own limits, or that of the settled runs and all references.

    Parameters
    ----------
    quantities : sequence of Quantity
        Those of a group follow each other.
    runs : sequence of ComparedRun
    leading : sequence of int
        Places of the runs that show the reference.
    """
    ranges: list[PlotRange] = []
    for _, group in groupby(quantities, key=lambda of: of.group if of.group in LINKED else of.name):
        siblings = list(group)
        columns = [[of.column(run.rows) for run in runs] for of in siblings]
        references = [of.desired(runs[place].rows) for of in siblings if of.desired for place in leading]
        together = [
            np.ravel(parts) for parts in (np.stack(of_run, axis=1) for of_run in zip(*columns, strict=True))
        ]
        bounds = siblings[0].limits or settled_bounds(runs, together, siblings[0].floor, references)
        for of, of_runs in zip(siblings, columns, strict=True):
            ranges.append(PlotRange(*bounds, () if of.limits else values_outside(runs, of_runs, bounds)))
    return ranges


def settled_bounds(
    runs: Sequence[ComparedRun], of_runs: Sequence[Array], least: float, references: Sequence[Array] = ()
) -> tuple[float, float]:
    """Return a range that contains every value, or the settled runs if that is much larger.

    A settled run is the second half and 85 % of the values of a complete run: a transient, a run that failed
    and a run that is far off do not flatten the others. If no run is complete, it is 85 % of each.

    Parameters
    ----------
    runs : sequence of ComparedRun
    of_runs : sequence of (n,) arrays
        Values of each run in the order of time; a number that is not finite is no value.
    least : float
        Half of the least range: smaller values must not look large.
    references : sequence of (n,) arrays
        Values that are always within the range.
    """
    finite = [np.where(np.isfinite(values), values, np.nan) for values in of_runs]
    complete = [
        values for run, values in zip(runs, finite, strict=True) if not run.early_end and _has_number(values)
    ]
    settled = [np.append(_usual(values), values[len(values) // 2 :]) for values in complete] or [
        _usual(values) for values in finite if _has_number(values)
    ]
    everything = value_bounds(of_runs)
    usual = _bounds([*_without_outliers(settled, least, references), *references])
    span = max(usual[1] - usual[0], 2 * least)
    low, high = everything if everything[1] - everything[0] <= CLIPPED_FROM * span else usual
    middle, half = (low + high) / 2, max(least, MARGIN * (high - low) / 2)
    return middle - half, middle + half


def _without_outliers(settled: Sequence[Array], least: float, references: Sequence[Array]) -> list[Array]:
    """Return the settled runs, smallest first, up to one that is much larger than the others."""
    ordered = sorted(settled, key=_size)
    if references:
        most = OFF_REFERENCE * max(least, *map(_size, references))
        return [values for values in ordered if _size(values) <= most]
    sizes = [max(least, _size(values)) for values in ordered]
    far = [place for place, size in enumerate(sizes[1:], start=1) if size > OUTLIER * sizes[place - 1]]
    return ordered[: far[0]] if far else ordered


def _size(values: Array) -> float:
    return float(np.nanmax(np.abs(values)))


def values_outside(
    runs: Sequence[ComparedRun], of_runs: Sequence[Array], bounds: tuple[float, float]
) -> tuple[Outside, ...]:
    """Return the farthest value of each run outside of some bounds."""
    outside = (
        _outside(place, run.table["t_s"], np.where(np.isfinite(values), values, np.nan), *bounds)
        for place, (run, values) in enumerate(zip(runs, of_runs, strict=True), start=1)
    )
    return tuple(item for item in outside if item)


def _has_number(values: Array) -> bool:
    return not np.all(np.isnan(values))


def _usual(values: Array) -> Array:
    """Return the bounds of the shortest interval that contains 85 % of the values."""
    ordered = np.sort(values[~np.isnan(values)])
    count = math.ceil(USUAL * len(ordered))
    lowest, highest = ordered[: len(ordered) - count + 1], ordered[count - 1 :]
    place = int(np.argmin(highest - lowest))
    return np.array([lowest[place], highest[place]])


def value_bounds(of_runs: Sequence[Array]) -> tuple[float, float]:
    """Return the bounds of all values that are finite; 0 if there is none."""
    return _bounds([values[np.isfinite(values)] for values in of_runs if np.any(np.isfinite(values))])


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
