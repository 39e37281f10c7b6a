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
    """How a trial ended."""

    COMPLETED = "completed"
    PRUNED = "pruned"
    """It could no longer be among the best."""
    LOST = "lost"
    """A row did not complete, or has no such figure."""


class Tried(NamedTuple):
    """What a trial gave.

    Attributes
    ----------
    ended : Ended
    reason : str
        Why it lost; empty where it did not.
    values : list of float
        Objectives, to be minimised: all of the rows, or the least that they can be.
    each : list of list of float
        The same of each row that was run, (rows, objectives).
    """

    ended: Ended
    reason: str
    values: list[float]
    each: list[list[float]]


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
    wanted: Sequence[Objective],
    has_lost: Callable[[Sequence[float]], bool],
    stop_requested: Callable[[], bool],
) -> Tried | None:
    """Run a trial; None where it was stopped on the way.

    Parameters
    ----------
    rows : Rows
    conditions : sequence of Row
        Rows of its law.
    fields : mapping
        Value of each field that its gains set.
    wanted : sequence of Objective
    has_lost : callable
        Whether a trial whose objectives are at least these has lost.
    stop_requested : callable
    """
    each: list[list[float]] = []
    for row in conditions:
        if stop_requested():
            return None
        result = rows.run(with_fields(row, fields))
        found = [optimise.of_row(objective, figure_of(result, objective)) for objective in wanted]
        numbers = [value for value in found if value is not None]
        if reason := _why_lost(row, result, wanted, found):
            return Tried(Ended.LOST, reason, _values(wanted, each, len(conditions)), each)
        each.append(numbers)
        values = _values(wanted, each, len(conditions))
        if len(each) < len(conditions) and has_lost(values):
            return Tried(Ended.PRUNED, "", values, each)
    return Tried(Ended.COMPLETED, "", values, each)


def with_fields(row: Row, fields: Mapping[str, float]) -> Row:
    """A row with the fields that gains set."""
    return row._replace(values={**row.values, **fields})


def figure_of(result: Result, objective: Objective) -> object:
    """Figure of a run that an objective is of."""
    return result.figures.get(objective.metric)


def _why_lost(row: Row, result: Result, wanted: Sequence[Objective], found: Sequence[float | None]) -> str:
    if result.status != Status.COMPLETED:
        more = result.error or result.reason
        return f"row {row.number}: {result.status}{f', {more}' if more else ''}"
    for objective, value in zip(wanted, found, strict=True):
        if value is None:
            return f"row {row.number}: no {objective.metric}{f', {result.error}' if result.error else ''}"
    return ""


def _values(wanted: Sequence[Objective], each: Sequence[Sequence[float]], rows: int) -> list[float]:
    return [
        optimise.of_rows(objective, [values[place] for values in each], rows)
        for place, objective in enumerate(wanted)
    ]
