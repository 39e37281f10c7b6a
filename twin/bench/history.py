"""The last seconds of a run, for plots: a row for each 20 ms of simulated time."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.signals import common_signals, width
from spheretwin.models.telemetry.table import Table

RATE_Hz = 50.0
LENGTH_s = 10.0


class History:
    """Rows of the signals that every run has, the newest ones alone; whoever reads it delays no one.

    Parameters
    ----------
    groups : int
        Coil groups.
    period_s : float, s
        From row to row of what is written.
    """

    def __init__(self, groups: int, period_s: float) -> None:
        self._signals = common_signals(groups)
        self._width = width(self._signals)
        self._each = max(1, round(1 / (RATE_Hz * period_s)))
        self._rows: deque[NDArray[np.float64]] = deque(maxlen=round(LENGTH_s * RATE_Hz))

    def write(self, first_tick: int, rows: Table) -> None:
        """Take those of some rows that are due, whatever the chunks; they must not change any more."""
        due = rows.values[-first_tick % self._each :: self._each]
        # A run begins its rows with these signals; a recording may have them in another order.
        if rows.signals[: len(self._signals)] != self._signals:
            parts = [rows[signal.name].reshape(len(rows), -1) for signal in self._signals]
            due = np.concatenate(parts, axis=1)[-first_tick % self._each :: self._each]
        self._rows.extend(due[-(self._rows.maxlen or 0) :, : self._width].copy())

    def read(self) -> dict[str, NDArray[np.float64]]:
        """The rows by signal, oldest first; a copy."""
        rows = list(self._rows)  # at once: the writer may be at work in another thread
        table = Table(self._signals, np.array(rows).reshape(len(rows), self._width))
        return {signal.name: table[signal.name] for signal in self._signals}
