"""Which figures suit a study: over one axis lines, over two a map, over more what the worst goes with."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.twin.study.report.ranking import ranked, strongest
from spheretwin.twin.study.report.reading import Array, Rows
from spheretwin.viz.figures.drawing import Drawing

if TYPE_CHECKING:
    from spheretwin.viz.figures.study_maps import Line, Panel

MOST_BARS, MOST_SCATTERS = 20, 8

# A map of more is no map: where each row has a value of its own, nothing stands beside anything.
MOST_SQUARES = 60

LEAST_SPREAD = 10
"""Completed rows from which on their distribution is one."""


def drawings(rows: Rows) -> Iterator[Drawing]:
    """Figures of a study, in the order of its page; none where no row was completed."""
    varied = {field: values for field, values in rows.axes.items() if len(_distinct(values)) > 1}
    if rows.main is None or not np.any(rows.completed):
        return
    listed = all(len(_distinct(values)) <= MOST_SQUARES for values in varied.values())
    if len(varied) == 1 and listed:
        yield _lines(rows, *next(iter(varied.items())))
    elif len(varied) == 2 and listed:
        yield _map(rows, varied)
    elif numbers := {field: values for field, values in varied.items() if values.dtype == np.float64}:
        yield from _many(rows, numbers)
    if np.count_nonzero(rows.completed) >= LEAST_SPREAD:
        yield _distributions(rows)


def _lines(rows: Rows, field: str, values: NDArray[Any]) -> Drawing:
    from spheretwin.viz.figures import study_maps

    x, places = _placed(values)
    figure = study_maps.lines(
        {law: _line(rows, law, places, len(x)) for law in rows.law_names},
        x if x.dtype == np.float64 else list(x),
        field,
        _quantity(rows),
        f"{rows.study['name']}: {_quantity(rows)}",
    )
    caption = (
        f"{_quantity(rows)} by {field}: the median of the completed rows a line, their whole range a band."
    )
    return Drawing("report_axis.png", caption, figure)


def _map(rows: Rows, varied: Mapping[str, NDArray[Any]]) -> Drawing:
    from spheretwin.viz.figures import study_maps

    (first, down), (second, across) = ((field, _placed(values)) for field, values in varied.items())
    panels = {law: _panel(rows, law, down[1], across[1]) for law in rows.law_names}
    figure = study_maps.maps(
        panels,
        (first, second),
        ([_told(each) for each in down[0]], [_told(each) for each in across[0]]),
        _quantity(rows),
        f"{rows.study['name']}: {_quantity(rows)}",
    )
    caption = (
        f"{_quantity(rows)} by {first} and {second}, a panel a law: the median of the completed rows."
        " A cross is where a row did not come to its end."
    )
    return Drawing("report_map.png", caption, figure)


def _many(rows: Rows, numbers: Mapping[str, NDArray[Any]]) -> Iterator[Drawing]:
    from spheretwin.viz.figures import study_spreads

    whole = {law: _whole(rows, law) for law in rows.law_names}
    whole = {law: chosen for law, chosen in whole.items() if np.count_nonzero(chosen) >= LEAST_SPREAD}
    if not whole:
        return
    y: Array = rows.figures[str(rows.main)]
    found = {
        law: ranked([each[chosen] for each in numbers.values()], y[chosen]) for law, chosen in whole.items()
    }
    order, names = strongest(found.values()), list(numbers)
    bars = order[:MOST_BARS]
    figure = study_spreads.ranks(
        [names[place] for place in bars],
        {law: rank._replace(by_value=rank.by_value[bars], by_distance=rank.by_distance[bars])
         for law, rank in found.items()},
        f"{rows.study['name']}: what {_quantity(rows)} goes with",
    )  # fmt: skip
    caption = (
        f"Spearman's rank correlation of {_quantity(rows)} with the value of each axis, and, as a ring, with"
        f" its distance from the middle one, over the completed rows: the {len(bars)} strongest of"
        f" {len(names)} axes. What does not matter is in the grey band 95 times of a hundred."
    )
    yield Drawing("report_ranks.png", caption, figure)
    shown = [names[place] for place in order[:MOST_SCATTERS]]
    figure = study_spreads.scatters(
        {name: {law: numbers[name][chosen] for law, chosen in whole.items()} for name in shown},
        {law: y[chosen] for law, chosen in whole.items()},
        _quantity(rows),
        f"{rows.study['name']}: {_quantity(rows)} over its {len(shown)} strongest axes",
    )
    caption = (
        f"{_quantity(rows)} of the completed rows over the {len(shown)} axes that it goes with most:"
        " a dot a row, a line the median of each tenth."
    )
    yield Drawing("report_strongest.png", caption, figure)


def _distributions(rows: Rows) -> Drawing:
    from spheretwin.viz.figures import study_spreads

    figures = {
        name: {law: values[(rows.laws == law) & rows.completed] for law in rows.law_names}
        for name, values in rows.figures.items()
    }
    numbers = {
        name: {law: values[np.isfinite(values)] for law, values in by_law.items()}
        for name, by_law in figures.items()
    }
    numbers = {name: by_law for name, by_law in numbers.items() if any(map(len, by_law.values()))}
    totals = {law: int(np.count_nonzero(rows.laws == law)) for law in rows.law_names}
    figure = study_spreads.distributions(numbers, totals, f"{rows.study['name']}: distributions")
    caption = (
        "Share of all rows that were completed with at most this: a curve ends below 1 by the rows that were"
        " not, or that never settled. Of a figure of each hinge, the largest of the three."
    )
    return Drawing("report_spread.png", caption, figure)


def _quantity(rows: Rows) -> str:
    return f"{rows.main}"


def _whole(rows: Rows, law: str) -> NDArray[np.bool_]:
    """Completed rows of a law that have the main figure."""
    return (rows.laws == law) & rows.completed & np.isfinite(rows.figures[str(rows.main)])


def _distinct(values: NDArray[Any]) -> list[Any]:
    return list(dict.fromkeys(values.tolist()))


def _placed(values: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Different values, numbers in their order, names in that of the study; and which each row has."""
    if values.dtype == np.float64:
        distinct, places = np.unique(values, return_inverse=True)
        return distinct, places
    names = _distinct(values)
    return np.array(names, dtype=object), np.array([names.index(each) for each in values])


def _panel(rows: Rows, law: str, down: NDArray[np.int64], across: NDArray[np.int64]) -> Panel:
    from spheretwin.viz.figures.study_maps import Panel

    shape = (int(down.max()) + 1, int(across.max()) + 1)
    line = _line(rows, law, down * shape[1] + across, shape[0] * shape[1])
    return Panel(line.median.reshape(shape), line.lost.reshape(shape))


def _line(rows: Rows, law: str, places: NDArray[np.int64], count: int) -> Line:
    from spheretwin.viz.figures.study_maps import Line

    of_law, whole = rows.laws == law, _whole(rows, law)
    values = rows.figures[str(rows.main)]
    spread = np.full((3, count), np.nan)
    for place in np.unique(places[whole]):
        spread[:, place] = np.quantile(values[whole & (places == place)], [0.5, 0, 1])
    lost = np.bincount(places[of_law & ~rows.completed], minlength=count) > 0
    return Line(spread[0], spread[1], spread[2], lost)


def _told(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
