"""Conclusion of a study in words, and its figures with the digits that their intervals support."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from math import floor, log10
from typing import Any

import numpy as np

from spheretwin.models.telemetry.status import Status
from spheretwin.scenario.fields import quantity_text
from spheretwin.study.statistics import StudyTable, ranked, strongest

LEAST_SPREAD = 10
"""Least number of completed rows for a distribution."""

MOST_RANKED = 10_000
"""Rows of a law, evenly spaced, that are ranked for the conclusion."""

MOST_DIGITS = 4
"""Significant digits of a figure whose interval has no width."""


def in_mrad(rows: StudyTable) -> StudyTable:
    """Return the rows with angles of metrics in mrad, in the names too."""
    return rows._replace(figures={mrad_name(name): factor(name) * of for name, of in rows.figures.items()})


def mrad_name(name: str) -> str:
    """Return the name of a metric on a page: an angle is in mrad."""
    return re.sub("_rad$", "_mrad", name)


def factor(name: str) -> float:
    """Return the factor from the unit of a metric to that on a page."""
    return 1e3 if name.endswith("_rad") else 1.0


def spread_text(figure: Mapping[str, Any], scale: float) -> str:
    """Return median, its interval and the range of the rows as text; a dash without a value.

    Parameters
    ----------
    figure : mapping
        With ``median``, ``median_95`` and ``range_95`` of `statistics.summary`.
    scale : float
        Factor of all numbers.
    """
    if figure["median"] is None:
        return "–"
    ends, bounds = ([end and scale * end for end in figure[name]] for name in ("median_95", "range_95"))
    median = scale * figure["median"]
    if bounds[0] == bounds[1]:
        return f"{median:.4g} (no spread)"
    places = decimals(median, bounds if None in ends or ends[0] == ends[1] else ends)
    low, high = (rounded(bound, places) for bound in bounds)
    shown = ", ".join("–" if end is None else rounded(end, places) for end in ends)
    return f"{rounded(median, places)} [{shown}] ({low} to {high})"


def decimals(value: float, interval: Sequence[float]) -> int:
    """Return the decimals of a value: rounding changes it by at most a sixth of half its interval.

    Parameters
    ----------
    value : float
    interval : two float
    """
    half = (interval[1] - interval[0]) / 2
    most = MOST_DIGITS - 1 - floor(log10(abs(value))) if value and np.isfinite(value) else 0
    return min(most, -floor(log10(half / 3))) if 0 < half < np.inf else most


def rounded(value: float, places: int) -> str:
    """Return a number with some decimals; digits before the point are not shown as zeros below."""
    return f"{round(value, places):.{max(places, 0)}f}"


def text(rows: StudyTable, summary: Mapping[str, Any]) -> str:
    """Return the conclusion: rows that did not complete, the main figure of each law, the strongest axis.

    Parameters
    ----------
    rows : StudyTable
    summary : mapping
        `statistics.summary` of the rows.
    """
    sentences = [_completion(rows)]
    medians = {law: of_law[rows.main] for law, of_law in summary.items() if rows.main in of_law}
    medians = {law: figure for law, figure in medians.items() if figure["median"] is not None}
    if medians:
        sentences += [
            _order(medians, str(rows.main)),
            *_dependences(rows, min(medians, key=_median(medians))),
        ]
    return " ".join(sentences)


def _completion(rows: StudyTable) -> str:
    ends = Counter(zip(rows.statuses.tolist(), rows.laws.tolist(), strict=True))
    lost = {end: count for end, count in ends.most_common() if end[0] != Status.COMPLETED}
    if not lost:
        return f"All {len(rows.laws)} rows completed."
    kinds = ", ".join(
        f"{count} {status.replace('_', ' ')} under {law}" for (status, law), count in lost.items()
    )
    return f"{sum(lost.values())} of {len(rows.laws)} rows did not complete: {kinds}."


def _median(figures: Mapping[str, Any]) -> Callable[[str], float]:
    return lambda law: float(figures[law]["median"])


def _order(figures: Mapping[str, Any], name: str) -> str:
    """Return the medians of the laws, the lowest first, and whether intervals tell the first two apart."""
    words, unit = _words(name)
    laws = sorted(figures, key=_median(figures))
    each = "; ".join(f"{law} {spread_text(figures[law], factor(name))}" for law in laws)
    sentence = f"Median {words}{unit}, with its 95 % interval and the range of 95 % of the rows: {each}."
    if len(laws) > 1:
        (_, high), (low, _) = (figures[law]["median_95"] for law in laws[:2])
        is_lower = high is not None and low is not None and high < low
        sentence += (
            f" That of {laws[0]} is the lowest."
            if is_lower
            else f" The intervals of {laws[0]} and {laws[1]} overlap: the two are not ranked."
        )
    return sentence


def _words(name: str) -> tuple[str, str]:
    """Return a metric in words, and its unit on a page after a comma."""
    words, comma, unit = quantity_text(mrad_name(name)).partition(", ")
    return words, comma + unit


def _dependences(rows: StudyTable, law: str) -> list[str]:
    """Return the axis with the strongest rank correlation under a law, if there are rows enough for one."""
    values = rows.figures[str(rows.main)]
    chosen = np.flatnonzero((rows.laws == law) & rows.completed & np.isfinite(values))
    chosen = chosen[:: 1 + len(chosen) // MOST_RANKED]
    numbers = {field: of[chosen] for field, of in rows.axes.items()
               if of.dtype == np.float64 and len(np.unique(of[chosen])) > 1}  # fmt: skip
    if not numbers or len(chosen) < LEAST_SPREAD:
        return []
    rank = ranked(list(numbers.values()), values[chosen])
    first = strongest([rank])[0]
    by_value = abs(rank.by_value[first]) >= abs(rank.by_distance[first])
    correlation = float((rank.by_value if by_value else rank.by_distance)[first])
    field = quantity_text(list(numbers)[first]).partition(", ")[0]
    kind = "" if by_value else "the distance from the middle of "
    if abs(correlation) <= rank.chance:
        return [f"Under {law} it depends on no axis more than by chance."]
    return [f"Under {law} it depends most on {kind}{field} (rank correlation {correlation:+.2f})."]
