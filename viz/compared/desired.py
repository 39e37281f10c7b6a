"""Which of some runs show what was asked for, where many were asked for the same."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spheretwin.models.telemetry.table import Table

# Times of ticks at different rates are products that differ in their last bits, and angles with them.
SAME_rad = 1e-9


def leaders(tables: Sequence[Table]) -> list[int]:
    """Places of the runs that show each desired motion longest, in order.

    Parameters
    ----------
    tables : sequence of Table
        With a row each at least.
    """
    found: list[int] = []
    for place in sorted(range(len(tables)), key=lambda place: -float(tables[place]["t_s"][-1])):
        if not any(_same(tables[place], tables[leader]) for leader in found):
            found.append(place)
    return sorted(found)


def _same(one: Table, other: Table) -> bool:
    """Whether two were asked for the same at all ticks that they have in common."""
    t_ns, others_ns = (np.round(each["t_s"] * 1e9).astype(np.int64) for each in (one, other))
    _, rows, others = np.intersect1d(t_ns, others_ns, assume_unique=True, return_indices=True)
    apart = np.abs(one["q_ref_rad"][rows] - other["q_ref_rad"][others])
    return bool(apart.max(initial=0.0) <= SAME_rad)
