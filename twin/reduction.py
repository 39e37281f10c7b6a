"""Reduction of rows to metrics: chunk by chunk, in compiled code, without storing the rows of a run.

All metrics of a run are one compiled call for each chunk, which releases the interpreter lock. Each sum adds
tick after tick, rounded at each: no figure depends on the chunks.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import numpy as np

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.compiled import for_types_of, inlined, rounding_each
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.signals import Signal, common_signals, offsets
from spheretwin.models.telemetry.table import Table
from spheretwin.scenario.sections import ResolvedScenario


@dataclass(frozen=True)
class PlannedRun:
    """Facts about a run that a metric knows before the first row.

    Attributes
    ----------
    scenario : ResolvedScenario
        Scenario at the start.
    actuator : Actuator
        Simulated actuator.
    ticks : int
        Planned control ticks; the run may end earlier.
    """

    scenario: ResolvedScenario
    actuator: Actuator
    ticks: int

    @property
    def period_s(self) -> float:
        """Control period, s."""
        return self.scenario.controller.period_s


class Metric(ABC):
    """Metric of a run; the result is bit-identical for any chunks.

    Parameters
    ----------
    planned : PlannedRun
        Facts about the run.

    Attributes
    ----------
    state : array or named tuple
        Numbers that `add` reads and changes.
    """

    labels: ClassVar[tuple[str, ...]] = ()
    """Names of the entries, if the value is a list."""

    reads: ClassVar[tuple[str, ...]]
    """Signals whose first columns `add` receives; -1 for one that the run does not log."""

    add: ClassVar[Any]
    """``add(rows, first, columns, state)``: compiled, processes the rows (n, width) of one chunk, the first
    of which is that of a tick of the run."""

    least_rows: ClassVar[int] = 1
    """Rows below which the metric has no value."""

    state: Any

    def __init__(self, planned: PlannedRun) -> None:
        self.planned, self._rows = planned, 0
        self.state = self.start(planned)

    @abstractmethod
    def start(self, planned: PlannedRun) -> Any:
        """Return the state before the first row."""

    def write(self, rows: Table) -> None:
        """Process the rows of one chunk, at least one."""
        write_all([self], rows)

    def begin(self, rows: int) -> int:
        """Prepare the state for a chunk of some rows; return the tick of its first row."""
        first, self._rows = self._rows, self._rows + rows
        return first

    def value(self) -> Any:
        """Return the value of the metric in JSON types; None if there are too few rows."""
        return self.result() if self._rows >= self.least_rows else None

    @abstractmethod
    def result(self) -> Any:
        """Return the value of at least `least_rows` rows."""

    def warnings(self) -> list[str]:
        """Return warnings that concern the validity of the figures, one line each."""
        return []


def write_all(metrics: Sequence[Metric], rows: Table) -> None:
    """Process the rows of one chunk, at least one, by metrics that have processed the same rows before."""
    kinds, planned = tuple(map(type, metrics)), metrics[0].planned
    columns = _columns_of(kinds, rows.signals, len(planned.actuator.groups))
    (first,) = {metric.begin(len(rows)) for metric in metrics}
    arguments = np.ascontiguousarray(rows.values), first, columns, tuple(metric.state for metric in metrics)
    if kinds not in _REDUCERS:  # all states of a kind of metric have the same types
        _REDUCERS[kinds] = for_types_of(_reducer_of(kinds), *arguments)
    _REDUCERS[kinds](*arguments)


_REDUCERS: dict[tuple[type[Metric], ...], Any] = {}
"""Machine code by the kinds of the metrics."""


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


def _reducer_of(kinds: tuple[type[Metric], ...]) -> Any:
    """Return the compiled function ``(rows, first, columns, states)`` that calls `add` of each metric."""
    add_all = _chain(kinds)

    @rounding_each
    def reduce_rows(rows: Any, first: Any, columns: Any, states: Any) -> None:
        add_all(rows, first, columns, states)

    return reduce_rows


def _chain(kinds: tuple[type[Metric], ...], place: int = 0) -> Any:
    """Return one function that calls all metrics, without a loop over functions."""
    if not kinds:
        return _add_nothing
    add, others = kinds[0].add, _chain(kinds[1:], place + 1)

    @inlined
    def add_and_continue(rows: Any, first: Any, columns: Any, states: Any) -> None:
        add(rows, first, columns[place], states[place])
        others(rows, first, columns, states)

    return add_and_continue


@inlined
def _add_nothing(rows: Any, first: Any, columns: Any, states: Any) -> None:
    pass
