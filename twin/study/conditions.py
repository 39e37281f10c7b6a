"""Medians of a study by law and condition: one combination of the values of its axes, over the seeds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.scenario.fields import quantity_text
from spheretwin.study.statistics import StudyTable, quantile_text
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
    figures = [f"{name}, degrees" for name in HINGES] if rows.hinges_rad is not None else [""]
    head = [*map(quantity_text, varied), "law", "rows", *figures]
    head = [name or quantity_text(str(rows.main)) for name in head]
    title = f"Medians by condition: {quantity_text(str(rows.main))}"
    return [PageSection(title, [METHOD, ResultTable("", head, body, len(varied) + 1)])]


def _row(rows: StudyTable, varied: list[str], chosen: NDArray[np.bool_], law: str) -> list[str]:
    complete = chosen & rows.completed
    first = int(np.flatnonzero(chosen)[0])
    values = [rows.axes[field][first] for field in varied]
    if rows.hinges_rad is None:
        figures = [rows.figures[str(rows.main)][complete]]
    else:
        hinges_deg = np.degrees(rows.hinges_rad[complete])
        figures = [hinges_deg[:, hinges].max(axis=1) for hinges in HINGES.values()]
    counted = f"{np.count_nonzero(complete)} of {np.count_nonzero(chosen)}"
    cells = (quantile_text(figure[np.isfinite(figure)], "{:.4g}".format) for figure in figures)
    return [*map(_axis_text, values), law, counted, *cells]


def _numbers(rows: StudyTable) -> NDArray[np.int64]:
    """Number of the condition of each row, in the order of their first rows."""
    number_of: dict[tuple[Any, ...], int] = {}
    columns = [values.tolist() for values in rows.axes.values()]
    places = (number_of.setdefault(values, len(number_of)) for values in zip(*columns, strict=True))
    return np.fromiter(places, dtype=np.int64)


def _axis_text(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
