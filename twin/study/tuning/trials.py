"""Trials: the rows of a law under some gains, one after the other, until they are complete or have lost."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from typing import NamedTuple

from spheretwin.models.telemetry.status import Status
from spheretwin.study import optimise
from spheretwin.study.grid import Row
from spheretwin.study.optimise import Objective
from spheretwin.study.row import RowResult, Rows


class Ended(StrEnum):
    """End of a trial."""

    COMPLETED = "completed"
    PRUNED = "pruned"
    """It could no longer be among the best."""
    LOST = "lost"
    """A row did not complete, or has no such figure."""


class Tried(NamedTuple):
    """Result of a trial.

    Attributes
    ----------
    ended : Ended
    reason : str
        Reason of a loss; empty without one.
    values : list of float
        Objectives, to be minimised: all of the rows, or the least that they can be.
    by_row : list of list of float
        Objectives of each row that was run, (rows, objectives).
    """

    ended: Ended
    reason: str
    values: list[float]
    by_row: list[list[float]]


class FinishedTrial(NamedTuple):
    """A finished trial."""

    number: int
    chosen: Mapping[str, float]
    """Values of its gains by their names."""
    tried: Tried


def run_trials(
    rows: Rows,
    conditions: Sequence[Row],
    fields: Sequence[Mapping[str, float]],
    objectives: Sequence[Objective],
    has_lost: Callable[[Sequence[float]], bool],
    stop_requested: Callable[[], bool],
) -> list[Tried | None]:
    """Run trials together, row by row; None for those that were stopped.

    Parameters
    ----------
    rows : Rows
    conditions : sequence of Row
        Rows of their law.
    fields : sequence of mapping
        For each trial, the value of each field that its gains set.
    objectives : sequence of Objective
    has_lost : callable
        Whether a trial whose objectives are at least these has lost.
    stop_requested : callable
    """
    by_row: list[list[list[float]]] = [[] for _ in fields]
    tried: list[Tried | None] = [None] * len(fields)
    for row in conditions:
        going = [trial for trial in range(len(fields)) if tried[trial] is None]
        if not going or stop_requested():
            break
        results = rows.run([with_fields(row, fields[trial]) for trial in going])
        for trial, result in zip(going, results, strict=True):
            tried[trial] = _ended(row, result, by_row[trial], len(conditions), objectives, has_lost)
    return tried


def _ended(
    row: Row,
    result: RowResult,
    by_row: list[list[float]],
    of: int,
    objectives: Sequence[Objective],
    has_lost: Callable[[Sequence[float]], bool],
) -> Tried | None:
    """Add the objectives of a row to those of a trial; return its end, if it has ended."""
    numbers = [optimise.of_row(objective, result.figures.get(objective.metric)) for objective in objectives]
    if reason := _reason_of_loss(row, result, objectives, numbers):
        return Tried(Ended.LOST, reason, values_of(objectives, by_row, of), by_row)
    by_row.append([number for number in numbers if number is not None])
    values = values_of(objectives, by_row, of)
    if len(by_row) == of:
        return Tried(Ended.COMPLETED, "", values, by_row)
    return Tried(Ended.PRUNED, "", values, by_row) if has_lost(values) else None


def with_fields(row: Row, fields: Mapping[str, float]) -> Row:
    """A row with the fields that gains set."""
    return row._replace(values={**row.values, **fields})


def _reason_of_loss(
    row: Row, result: RowResult, objectives: Sequence[Objective], numbers: Sequence[float | None]
) -> str:
    if result.status != Status.COMPLETED:
        more = result.error or result.reason
        return f"row {row.number}: {result.status}{f', {more}' if more else ''}"
    for objective, value in zip(objectives, numbers, strict=True):
        if value is None:
            return f"row {row.number}: no {objective.metric}{f', {result.error}' if result.error else ''}"
    return ""


def values_of(objectives: Sequence[Objective], by_row: Sequence[Sequence[float]], rows: int) -> list[float]:
    """Objectives of a trial of a number of rows, some of which were run."""
    return [
        optimise.of_rows(objective, [values[i] for values in by_row], rows)
        for i, objective in enumerate(objectives)
    ]
