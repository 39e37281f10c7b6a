"""Runs of a comparison: their data, references and spectra."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.status import Level
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.quantities import QuantityRows

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
