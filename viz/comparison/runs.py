"""Runs of a comparison: their data, references, spectra, and the ranges of their plots."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.status import Level
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.layout.extents import CLIPPED_FROM, MARGIN, USUAL, number
from spheretwin.viz.quantities import Quantity, QuantityRows

Event = tuple[float, Level, str]
"""Simulated time in s, level, text."""


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


def _same(one: Table, other: Table) -> bool:
    """True if two runs have the same reference at all common ticks."""
    t_ns, others_ns = (np.round(table["t_s"] * 1e9).astype(np.int64) for table in (one, other))
    _, rows, others = np.intersect1d(t_ns, others_ns, assume_unique=True, return_indices=True)
    apart = np.abs(one["q_ref_rad"][rows] - other["q_ref_rad"][others])
    return bool(apart.max(initial=0.0) <= SAME_rad)


Array = NDArray[np.float64]


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
