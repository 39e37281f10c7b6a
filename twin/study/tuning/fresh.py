"""The best trials under seeds that none was chosen by: the least of many figures is lucky in its own."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

from spheretwin.twin.study.grid import Grid
from spheretwin.twin.study.row import Rows
from spheretwin.twin.study.tuning import trial
from spheretwin.twin.study.tuning.section import Optimise
from spheretwin.twin.study.tuning.trial import Ended


class Fresh(NamedTuple):
    """What gains give under fresh seeds.

    Attributes
    ----------
    reason : str
        Why they lost; empty where they did not.
    values : list of float
        Objectives, to be minimised.
    """

    reason: str
    values: list[float]


def fresh(
    rows: Rows,
    law: Mapping[str, Any] | None,
    optimise: Optimise,
    fields: Mapping[int, Mapping[str, float]],
    threads: int | None,
    stop_requested: Callable[[], bool],
) -> dict[int, Fresh]:
    """Run some trials of a law under as many further seeds as the study says.

    Parameters
    ----------
    rows : Rows
    law : mapping or None
    optimise : Optimise
    fields : mapping
        Value of each field that its gains set, by trial.
    threads : int, optional
    stop_requested : callable

    Returns
    -------
    dict
        By trial; empty without fresh seeds, and without those that were stopped on the way.
    """
    if not optimise.fresh:
        return {}
    seeds = rows.study.seeds
    longer = Grid(rows.study.model_copy(update={"seeds": seeds + optimise.fresh}))
    conditions = [row for row in longer if row.law == law and row.repeat >= seeds]

    def judged(number: int) -> Fresh | None:
        tried = trial.carried_out(
            rows, conditions, fields[number], optimise.objective, lambda _: False, stop_requested
        )
        if tried is None:
            return None
        return Fresh(tried.reason, tried.values if tried.ended == Ended.COMPLETED else [])

    with ThreadPoolExecutor(threads or os.cpu_count(), thread_name_prefix="fresh") as pool:
        found = zip(fields, pool.map(judged, fields), strict=True)
        return {number: each for number, each in found if each is not None}
