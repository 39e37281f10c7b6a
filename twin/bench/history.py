"""The last seconds of a run, for plots: a row for each 20 ms of simulated time."""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.signals import common_signals, width
from spheretwin.models.telemetry.table import Table

RATE_Hz = 50.0
LENGTH_s = 10.0


class History:
    """Rows of the signals that every run has, the newest ones alone.

    Parameters
    ----------
    groups : int
        Coil groups.
    period_s : float, s
        From row to row of what is written.
    """

    def __init__(self, groups: int, period_s: float) -> None:
        self._signals = common_signals(groups)
        self._each = max(1, round(1 / (RATE_Hz * period_s)))
        rows = round(LENGTH_s * RATE_Hz)
        self._lock = threading.Lock()
        self._ring = np.empty((rows, width(self._signals)))
        self._written = 0

    def write(self, first_tick: int, rows: Table) -> None:
        """Take those of some rows that are due, whatever the chunks."""
        names = [signal.name for signal in self._signals]
        due = rows.values[-first_tick % self._each :: self._each][-len(self._ring) :]
        if rows.signals[: len(names)] != self._signals:
            parts = [rows[name].reshape(len(rows), -1) for name in names]
            due = np.concatenate(parts, axis=1)[-first_tick % self._each :: self._each][-len(self._ring) :]
        with self._lock:
            places = (self._written + np.arange(len(due))) % len(self._ring)
            self._ring[places] = due[:, : self._ring.shape[1]]
            self._written += len(due)

    def read(self) -> dict[str, NDArray[np.float64]]:
        """The rows by signal, oldest first; a copy."""
        with self._lock:
            kept = min(self._written, len(self._ring))
            rows = self._ring[(self._written - kept + np.arange(kept)) % len(self._ring)]
        table = Table(self._signals, rows)
        return {signal.name: table[signal.name].copy() for signal in self._signals}
