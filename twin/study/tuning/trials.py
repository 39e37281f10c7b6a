"""One trial: the rows of a law under some gains, one after the other, until it is complete or has lost."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from typing import NamedTuple

from spheretwin.models.telemetry.status import Status
from spheretwin.study import optimise
from spheretwin.study.grid import Row
from spheretwin.study.optimise import Objective
from spheretwin.study.row import Result, Rows


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


def run_trial(
    rows: Rows,
    conditions: Sequence[Row],
    fields: Mapping[str, float],
    objectives: Sequence[Objective],
    has_lost: Callable[[Sequence[float]], bool],
    stop_requested: Callable[[], bool],
) -> Tried | None:
    """Run a trial; None if it was stopped.

    Parameters
    ----------
    rows : Rows
    conditions : sequence of Row
        Rows of its law.
    fields : mapping
        Value of each field that its gains set.
    objectives : sequence of Objective
    has_lost : callable
        Whether a trial whose objectives are at least these has lost.
    stop_requested : callable
    """
    by_row: list[list[float]] = []
    for row in conditions:
        if stop_requested():
            return None
        (result,) = rows.run([with_fields(row, fields)])
        numbers = [
            optimise.of_row(objective, result.figures.get(objective.metric)) for objective in objectives
        ]
        if reason := _reason_of_loss(row, result, objectives, numbers):
            return Tried(Ended.LOST, reason, values_of(objectives, by_row, len(conditions)), by_row)
        by_row.append([number for number in numbers if number is not None])
        values = values_of(objectives, by_row, len(conditions))
        if len(by_row) < len(conditions) and has_lost(values):
            return Tried(Ended.PRUNED, "", values, by_row)
    return Tried(Ended.COMPLETED, "", values, by_row)


def with_fields(row: Row, fields: Mapping[str, float]) -> Row:
    """A row with the fields that gains set."""
    return row._replace(values={**row.values, **fields})


def _reason_of_loss(
    row: Row, result: Result, objectives: Sequence[Objective], numbers: Sequence[float | None]
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
