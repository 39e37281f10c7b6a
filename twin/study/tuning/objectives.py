"""From the figures of a trial's rows to its objectives, and what is certain of them before all are known.

Everything here is to be minimised: an objective that is to be large has its sign changed.

The worst over all rows is at least the worst over some, and a median over all is at least that where every
row still to come is as good as can be. Where a finished trial is at least as good as such a bound in every
objective, and better in one, the trial can be neither the best nor on the front: nothing is lost by ending
it. No more is concluded from what is not known yet.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from typing import Any

from spheretwin.twin.study.tuning.section import Objective

BEST = -math.inf


def of_row(objective: Objective, figure: Any) -> float | None:
    """A figure of one run as one number to be minimised; None where it is none."""
    entries = figure if isinstance(figure, list) else [figure]
    chosen = [entries[place] for place in objective.places] if objective.of and len(entries) == 3 else entries
    if not chosen or not all(_is_number(each) for each in chosen):
        return None
    return max(objective.sign * float(each) for each in chosen)


def of_rows(objective: Objective, known: Sequence[float], rows: int) -> float:
    """Objective of a trial, or the least that it can be while some of its rows are still to come.

    Parameters
    ----------
    objective : Objective
    known : sequence of float
        Of the rows that have been run, to be minimised; one at least where no row is to come.
    rows : int
        Of the trial.
    """
    if objective.over == "first":
        return known[0] if known else BEST
    if objective.over == "geometric_mean":
        return statistics.geometric_mean(known) if len(known) == rows and min(known) > 0 else 0.0
    whole = [*known, *[BEST] * (rows - len(known))]
    return max(whole) if objective.over == "worst" else statistics.median(whole)


def best_within(values: Mapping[int, Sequence[float]], limit: float) -> int | None:
    """Trial with the least first objective among those whose second is within a limit; None without any."""
    within = [number for number, each in values.items() if each[1] <= limit]
    return min(within, key=lambda number: (*values[number], number), default=None)


def dominates(one: Sequence[float], other: Sequence[float]) -> bool:
    """Whether objectives are as good as others in each, and better in one."""
    pairs = list(zip(one, other, strict=True))
    return all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
