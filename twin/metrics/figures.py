"""Figures: the metrics of a run, or of the runs of a block, by name."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from spheretwin.metrics import CHECKS, METRICS
from spheretwin.metrics.reduction import PlannedRun, Reduction, write_all
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.table import Table


class Figures:
    """Sink that computes metrics of a run; those of the runs of a block by its `reduction`.

    Parameters
    ----------
    planned : PlannedRun
        Facts about the runs before their first row.
    names : iterable of str
        Metrics; all unless given.
    """

    def __init__(self, planned: PlannedRun, names: Iterable[str] = METRICS) -> None:
        self._runs = planned.runs
        every = {name: kind(planned) for name, kind in METRICS.items()}
        self._metrics = {name: every[name] for name in names}
        # All of them, whatever the names: one reducer is compiled for all runs.
        self._all = [*every.values(), *(check(planned) for check in CHECKS)]

    def write(self, rows: Table) -> None:
        """Process the rows of one chunk."""
        if len(rows):
            write_all(self._all, rows)

    def note(self, t_s: float, text: str) -> None:
        """Ignore a message: it changes no figure."""

    def finish(self, status: str) -> None:
        """Ignore the end of the run: it changes no figure."""

    def reduction(self, signals: tuple[Signal, ...], ticks: int) -> Reduction:
        """Return the compiled reduction of the telemetry of all runs up to a tick."""
        return Reduction(self._all, signals, ticks)

    def values(self) -> dict[str, Any]:
        """Return the figures of the only run by name; None for a figure with too few rows."""
        return self.of_each_run()[0]

    def of_each_run(self) -> list[dict[str, Any]]:
        """Return the figures of each run by name; None for a figure with too few rows."""
        columns = [metric.values() for metric in self._metrics.values()]
        runs = zip(*columns, strict=True) if columns else [()] * self._runs
        return [dict(zip(self._metrics, values, strict=True)) for values in runs]

    def warnings(self) -> list[str]:
        """Return warnings that concern the validity of the figures, one line each."""
        return [line for metric in self._all for line in metric.warnings()]
