"""A run whose file keeps some of its rows, as if it had one at every tick: each is held until the next."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.table import Table


def held(table: Table, period_s: float) -> Table:
    """Rows at every tick from the first to the last, each that of the latest that there is.

    Parameters
    ----------
    table : Table
        Some rows of a run, in the order of time.
    period_s : float
        Time between ticks, s.
    """
    if not len(table):
        return table
    ticks = ticks_of(table, period_s)
    every = np.arange(ticks[0], ticks[-1] + 1)
    rows = Table(table.signals, table.values[np.searchsorted(ticks, every, side="right") - 1])
    rows["t_s"][:] = every * period_s
    return rows


def ticks_of(table: Table, period_s: float) -> NDArray[np.int64]:
    """Tick of each row."""
    return np.rint(table["t_s"] / period_s).astype(np.int64)
