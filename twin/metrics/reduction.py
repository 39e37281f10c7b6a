"""Reduction of telemetry to metrics: chunk by chunk, in compiled code, without storing it.

A metric holds the states of all runs of a block. All metrics are one compiled call for each chunk of a run.
Each sum adds tick after tick, rounded at each: no figure depends on the chunks, or on the other runs.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.compiled import for_types_of, inlined, rounding_each
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.signals import Signal, common_signals, offsets
from spheretwin.models.telemetry.table import Table
from spheretwin.scenario.sections import ResolvedScenario


@dataclass(frozen=True)
class PlannedRun:
    """Facts about a run, or a block of runs, that a metric knows before the first row.

    Attributes
    ----------
    scenario : ResolvedScenario
        Scenario at the start; of a block, its columns (`models.base.columns`).
    actuator : Actuator
        Simulated actuator.
    ticks : int
        Planned control ticks; a run may end earlier.
    runs : int
        Of the block.
    """

    scenario: ResolvedScenario
    actuator: Actuator
    ticks: int
    runs: int = 1

    @property
    def period_s(self) -> float:
        """Control period, s."""
        return self.scenario.controller.period_s


class Metric(ABC):
    """Metric of the runs of a block; the result is bit-identical for any chunks.

    Parameters
    ----------
    planned : PlannedRun
        Facts about the runs.

    Attributes
    ----------
    state : array or named tuple of arrays
        Numbers that `add` reads and changes; the first index is that of the run.
    """

    labels: ClassVar[tuple[str, ...]] = ()
    """Names of the entries, if the value is a list."""

    reads: ClassVar[tuple[str, ...]]
    """Signals whose first columns `add` receives; -1 for one that the runs do not log."""

    add: ClassVar[Any]
    """``add(rows, first, columns, state, run)``: compiled, processes the rows (n, width) of one chunk of a
    run, the first of which is that of a tick of the run."""

    least_rows: ClassVar[int] = 1
    """Rows below which the metric has no value."""

    state: Any

    def __init__(self, planned: PlannedRun) -> None:
        self.planned, self.rows = planned, np.zeros(planned.runs, np.int64)
        self.state = self.start(planned)

    @abstractmethod
    def start(self, planned: PlannedRun) -> Any:
        """Return the states before the first row."""

    def write(self, rows: Table) -> None:
        """Process the rows of one chunk of the only run, at least one."""
        write_all([self], rows)

    # Not abstract: the states of most metrics have one size, whatever the ticks.
    def reserve(self, ticks: int) -> None:  # noqa: B027
        """Extend the states to a number of ticks, if their size depends on it."""

    def values(self) -> list[Any]:
        """Return the value of the metric for each run in JSON types; None if there are too few rows."""
        rows = np.maximum(self.rows, self.least_rows)
        counted = zip(self.rows.tolist(), self.results(rows), strict=True)
        return [value if count >= self.least_rows else None for count, value in counted]

    @abstractmethod
    def results(self, rows: NDArray[np.int64]) -> list[Any]:
        """Return the value of each run, for its number of rows, at least `least_rows`."""

    def warnings(self) -> list[str]:
        """Return warnings that concern the validity of the figures of the first run, one line each."""
        return []


def write_all(metrics: Sequence[Metric], rows: Table) -> None:
    """Process the rows of one chunk of the only run by metrics that have processed the same rows before."""
    reduction = Reduction(metrics, rows.signals, len(rows) + int(metrics[0].rows[0]))
    values = np.ascontiguousarray(rows.values)
    reduction.entry(values, int(metrics[0].rows[0]), *reduction.arguments, 0)
    reduction.count([len(rows)])


class Reduction:
    """Compiled reduction of the telemetry of some runs to all metrics.

    Parameters
    ----------
    metrics : sequence of Metric
    signals : tuple of Signal
        Columns of the telemetry.
    ticks : int
        To which it is used.
    """

    def __init__(self, metrics: Sequence[Metric], signals: tuple[Signal, ...], ticks: int) -> None:
        self._metrics, kinds = metrics, tuple(map(type, metrics))
        for metric in metrics:
            metric.reserve(ticks)
        columns = _columns_of(kinds, signals, len(metrics[0].planned.actuator.groups))
        self.arguments = columns, tuple(metric.state for metric in metrics)
        self.function = _reducer_of(kinds)
        """Compiled ``(rows, first, columns, states, run)``; the arguments in the middle are `arguments`."""

    @property
    def entry(self) -> Any:
        """Machine code of `function`."""
        return for_types_of(self.function, np.empty((0, 0)), 0, *self.arguments, 0)

    def count(self, rows: Any) -> None:
        """Count the rows that each run has gained."""
        for metric in self._metrics:
            metric.rows += rows


@cache
def _columns_of(kinds: tuple[type[Metric], ...], signals: tuple[Signal, ...], groups: int) -> Any:
    """Return the first columns of the signals that some metrics read, a tuple for each.

    Raises
    ------
    InputError
        A signal of every run is missing, or is that of another number of groups.
    """
    first, sizes = offsets(signals), {signal.name: signal.size for signal in signals}
    common = {signal.name: signal.size for signal in common_signals(groups)}
    for name in {name for kind in kinds for name in kind.reads} & common.keys():
        if sizes.get(name) != common[name]:
            raise InputError(
                f"metric: expected telemetry with {common[name]} columns of {name},"
                f" received {sizes.get(name, 'none')}"
            )
    return tuple(tuple(first.get(name, -1) for name in kind.reads) for kind in kinds)


@cache
def _reducer_of(kinds: tuple[type[Metric], ...]) -> Any:
    """Return the compiled function that calls `add` of each metric."""
    add_all = _chain(kinds)

    @rounding_each
    def reduce_rows(rows: Any, first: Any, columns: Any, states: Any, run: Any) -> None:
        add_all(rows, first, columns, states, run)

    return reduce_rows


def _chain(kinds: tuple[type[Metric], ...], place: int = 0) -> Any:
    """Return one function that calls all metrics, without a loop over functions."""
    if not kinds:
        return _add_nothing
    add, others = kinds[0].add, _chain(kinds[1:], place + 1)

    @inlined
    def add_and_continue(rows: Any, first: Any, columns: Any, states: Any, run: Any) -> None:
        add(rows, first, columns[place], states[place], run)
        others(rows, first, columns, states, run)

    return add_and_continue


@inlined
def _add_nothing(rows: Any, first: Any, columns: Any, states: Any, run: Any) -> None:
    pass
