"""A whole run's telemetry in memory, for those who need all of it at once."""

from __future__ import annotations

import numpy as np

from spheretwin.models.telemetry.signals import Signal, width
from spheretwin.models.telemetry.table import Table, allocated


class KeptTelemetry:
    """Follows a run and keeps its rows.

    Parameters
    ----------
    signals : tuple of Signal
        Columns at the start. Where a change on the way brings others, they are added; a column is NaN at
        the ticks that had none.
    ticks : int
        Planned; no more rows are kept.

    Raises
    ------
    InputError
        There is not so much memory.
    """

    def __init__(self, signals: tuple[Signal, ...], ticks: int) -> None:
        self._table = Table(signals, allocated(ticks, width(signals)))
        self._rows = 0

    @property
    def table(self) -> Table:
        """The rows so far (a view)."""
        return self._table.rows(0, self._rows)

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk."""
        if missing := tuple(signal for signal in rows.signals if signal not in self._table.signals):
            self._widen(missing)
        first, self._rows = self._rows, self._rows + len(rows)
        here = self._table.rows(first, self._rows)
        if rows.signals == here.signals:
            here.values[:] = rows.values
            return
        here.values[:] = np.nan
        for signal in rows.signals:
            here[signal.name][:] = rows[signal.name]

    def note(self, t_s: float, text: str) -> None:
        """The journal is not among the rows."""

    def finish(self, status: str) -> None:
        """Nothing remains to be done."""

    def _widen(self, more: tuple[Signal, ...]) -> None:
        before = self._table
        signals = before.signals + more
        self._table = Table(signals, allocated(len(before), width(signals)))
        self._table.values[:, : before.values.shape[1]] = before.values
        self._table.values[:, before.values.shape[1] :] = np.nan
