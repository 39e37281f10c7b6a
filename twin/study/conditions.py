"""Medians of a study by law and condition: one combination of the values of its axes, over the seeds."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array
from spheretwin.scenario.fields import quantity_text
from spheretwin.study.conclusion import decimals, factor, mrad_name, rounded
from spheretwin.study.statistics import StudyTable, interval, quantile_text
from spheretwin.viz.pages.markdown import PageSection, ResultTable

MOST_CONDITIONS = 60
"""Largest number of conditions that are listed."""

HINGES: Mapping[str, tuple[int, ...]] = {"α": (0,), "β": (1,), "γ": (2,), "worse of α and β": (0, 1)}
"""Hinges of each column; an encoder of coarse steps may make γ the largest of the three."""

METHOD = (
    "Median over the completed rows of one law under one condition [its 95 % interval]. Two medians whose"
    " intervals overlap are not ranked."
)


def section(rows: StudyTable) -> list[PageSection]:
    """Section of the table; none if there is one condition, more than are listed, or one row of each."""
    numbers = _numbers(rows)
    count = int(numbers.max(initial=-1)) + 1
    if not 1 < count <= MOST_CONDITIONS or count * len(rows.law_names) >= len(numbers) or rows.main is None:
        return []
    varied = [field for field, values in rows.axes.items() if len(set(values.tolist())) > 1]
    body = [
        _row(rows, varied, (numbers == number) & (rows.laws == law), law)
        for number in range(count)
        for law in rows.law_names
        if np.any((numbers == number) & (rows.laws == law))
    ]
    figures = [f"{name}, mrad" for name in HINGES] if rows.hinges_rad is not None else [""]
    head = [*map(quantity_text, varied), "law", "rows", *figures]
    main = quantity_text(mrad_name(str(rows.main)))
    head = [name or main for name in head]
    title = f"Medians by condition: {main}"
    return [PageSection(title, [METHOD, ResultTable("", head, body, len(varied) + 1)])]


def _row(rows: StudyTable, varied: list[str], chosen: NDArray[np.bool_], law: str) -> list[str]:
    complete = chosen & rows.completed
    first = int(np.flatnonzero(chosen)[0])
    values = [rows.axes[field][first] for field in varied]
    if rows.hinges_rad is None:
        figures = [factor(str(rows.main)) * rows.figures[str(rows.main)][complete]]
    else:
        hinges_mrad = 1e3 * rows.hinges_rad[complete]
        figures = [hinges_mrad[:, hinges].max(axis=1) for hinges in HINGES.values()]
    counted = f"{np.count_nonzero(complete)} of {np.count_nonzero(chosen)}"
    cells = map(_median_text, figures)
    return [*map(_axis_text, values), law, counted, *cells]


def _median_text(figure: Array) -> str:
    """Return the median of the finite values and its interval, with the digits that this supports."""
    numbers = figure[np.isfinite(figure)]
    ends = [end for end in interval(numbers) if np.isfinite(end)]
    places = decimals(float(np.median(numbers)), ends) if len(ends) == 2 else None
    text = "{:.4g}".format if places is None else partial(rounded, places=places)
    return quantile_text(numbers, text)


def _numbers(rows: StudyTable) -> NDArray[np.int64]:
    """Number of the condition of each row, in the order of their first rows."""
    number_of: dict[tuple[Any, ...], int] = {}
    columns = [values.tolist() for values in rows.axes.values()]
    places = (number_of.setdefault(values, len(number_of)) for values in zip(*columns, strict=True))
    return np.fromiter(places, dtype=np.int64)


def _axis_text(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
