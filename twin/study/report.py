"""Page of a study: lines over one axis, a map over two, rank correlations over more, tables of the rows."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import shown
from spheretwin.scenario.fields import quantity_text
from spheretwin.study import conclusion, conditions
from spheretwin.study.conclusion import LEAST_SPREAD
from spheretwin.study.statistics import StudyTable, ranked, strongest
from spheretwin.viz.pages import markdown as pieces
from spheretwin.viz.pages.markdown import Drawing, PageSection, ReportPage, ResultTable

if TYPE_CHECKING:
    from spheretwin.viz.figures.maps import MapPanel, StudyLine


MOST_BARS, MOST_SCATTERS = 20, 8

# Largest number of values on an axis of a map.
MOST_SQUARES = 60

MOST_RANKED = 100_000
"""Rows from which on only some of a law, evenly spaced, are ranked and drawn as dots."""


def drawings(rows: StudyTable) -> Iterator[Drawing]:
    """Figures of a study, in the order of its page; none without a completed row."""
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


def _lines(rows: StudyTable, field: str, values: NDArray[Any]) -> Drawing:
    from spheretwin.viz.figures import maps

    x, places = _placed(values)
    figure = maps.lines(
        {law: _line(rows, law, places, len(x)) for law in rows.law_names},
        x if x.dtype == np.float64 else list(x),
        quantity_text(field),
        _quantity(rows),
        f"{rows.study['name']}: {_quantity(rows)}",
    )
    caption = (
        f"Median (line) and range (band) of the completed rows: {_quantity(rows)}, by {quantity_text(field)}."
    )
    return Drawing("report_axis.svg", caption, figure)


def _map(rows: StudyTable, varied: Mapping[str, NDArray[Any]]) -> Drawing:
    from spheretwin.viz.figures import maps

    (first, down), (second, across) = ((field, _placed(values)) for field, values in varied.items())
    panels = {law: _panel(rows, law, down[1], across[1]) for law in rows.law_names}
    figure = maps.maps(
        panels,
        (quantity_text(first), quantity_text(second)),
        ([_value_text(value) for value in down[0]], [_value_text(value) for value in across[0]]),
        _quantity(rows),
        f"{rows.study['name']}: {_quantity(rows)}",
    )
    caption = (
        f"Median of the completed rows, one panel for each law: {_quantity(rows)}."
        " A cross marks a cell with a row that did not complete."
    )
    return Drawing("report_map.svg", caption, figure)


def _many(rows: StudyTable, numbers: Mapping[str, NDArray[Any]]) -> Iterator[Drawing]:
    from spheretwin.viz.figures import distributions

    complete = {law: np.flatnonzero(_complete(rows, law)) for law in rows.law_names}
    complete = {law: of_law[:: 1 + len(of_law) // MOST_RANKED] for law, of_law in complete.items()
                if len(of_law) >= LEAST_SPREAD}  # fmt: skip
    if not complete:
        return
    y: Array = rows.figures[str(rows.main)]
    ranks = {
        law: ranked([values[of_law] for values in numbers.values()], y[of_law])
        for law, of_law in complete.items()
    }
    order, names = strongest(ranks.values()), list(map(quantity_text, numbers))
    bars = order[:MOST_BARS]
    figure = distributions.ranks(
        [names[place] for place in bars],
        {law: rank._replace(by_value=rank.by_value[bars], by_distance=rank.by_distance[bars])
         for law, rank in ranks.items()},
        f"{rows.study['name']}: correlation of {_quantity(rows)}, with each axis",
    )  # fmt: skip
    partial = all(rank.is_partial for rank in ranks.values())
    effects = " The effect of the other axes is removed." if partial else ""
    caption = (
        f"Spearman's rank correlation of {_quantity(rows)}, with the value of each axis (bar) and with the"
        f" distance of the value from its median (ring): the {len(bars)} strongest of {len(names)} axes, over"
        f" the completed rows.{effects} An axis without effect is within the grey band with a probability of"
        " 95 %."
    )
    yield Drawing("report_ranks.svg", caption, figure)
    shown = [list(numbers)[place] for place in order[:MOST_SCATTERS]]
    figure = distributions.scatters(
        {
            quantity_text(name): {law: numbers[name][of_law] for law, of_law in complete.items()}
            for name in shown
        },
        {law: y[of_law] for law, of_law in complete.items()},
        _quantity(rows),
        f"{rows.study['name']}: {_quantity(rows)}, over the {len(shown)} strongest axes",
    )
    caption = (
        f"Completed rows over the {len(shown)} axes with the strongest correlation: {_quantity(rows)}."
        " A dot is a row, a line the median of each tenth of the rows."
    )
    yield Drawing("report_strongest.svg", caption, figure)


def _distributions(rows: StudyTable) -> Drawing:
    from spheretwin.viz.figures import distributions

    figures = {
        name: {law: values[(rows.laws == law) & rows.completed] for law in rows.law_names}
        for name, values in rows.figures.items()
    }
    numbers = {
        name: {law: values[np.isfinite(values)] for law, values in by_law.items()}
        for name, by_law in figures.items()
    }
    numbers = {name: by_law for name, by_law in numbers.items() if _differ(by_law.values())}
    totals = {law: int(np.count_nonzero(rows.laws == law)) for law in rows.law_names}
    steps = {law: 1 + total // MOST_RANKED for law, total in totals.items()}
    numbers = {
        name: {law: np.sort(values)[steps[law] // 2 :: steps[law]] for law, values in by_law.items()}
        for name, by_law in numbers.items()
    }
    shares = {law: total / steps[law] for law, total in totals.items()}
    numbers = {quantity_text(name): by_law for name, by_law in numbers.items()}
    figure = distributions.distributions(numbers, shares, f"{rows.study['name']}: distributions")
    caption = (
        "Share of all rows that completed with at most this value. A curve ends below 1 if some rows did not"
        " complete or never settled. Of a metric of each hinge, the largest of the three values is shown."
    )
    return Drawing("report_spread.svg", caption, figure)


def _quantity(rows: StudyTable) -> str:
    return quantity_text(str(rows.main))


def _complete(rows: StudyTable, law: str) -> NDArray[np.bool_]:
    """Completed rows of a law that have the main figure."""
    return (rows.laws == law) & rows.completed & np.isfinite(rows.figures[str(rows.main)])


def _differ(several: Iterable[Array]) -> bool:
    """True if there are two different numbers."""
    return len(np.unique(np.concatenate(list(several)))) > 1


def _distinct(values: NDArray[Any]) -> list[Any]:
    return list(dict.fromkeys(values.tolist()))


def _placed(values: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Distinct values, numbers sorted and names in the order of the study, and the index of each row."""
    if values.dtype == np.float64:
        distinct, places = np.unique(values, return_inverse=True)
        return distinct, places
    names = _distinct(values)
    return np.array(names, dtype=object), np.array([names.index(value) for value in values])


def _panel(rows: StudyTable, law: str, down: NDArray[np.int64], across: NDArray[np.int64]) -> MapPanel:
    from spheretwin.viz.figures.maps import MapPanel

    shape = (int(down.max()) + 1, int(across.max()) + 1)
    line = _line(rows, law, down * shape[1] + across, shape[0] * shape[1])
    return MapPanel(line.median.reshape(shape), line.lost.reshape(shape))


def _line(rows: StudyTable, law: str, places: NDArray[np.int64], count: int) -> StudyLine:
    from spheretwin.viz.figures.maps import StudyLine

    of_law, complete = rows.laws == law, _complete(rows, law)
    values = rows.figures[str(rows.main)]
    spread = np.full((3, count), np.nan)
    for place in np.unique(places[complete]):
        spread[:, place] = np.quantile(values[complete & (places == place)], [0.5, 0, 1])
    lost = np.bincount(places[of_law & ~rows.completed], minlength=count) > 0
    return StudyLine(spread[0], spread[1], spread[2], lost)


def _value_text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


NAME = "report"

MOST_NAMED = 5
"""Number of listed rows, of the worst and of the failed ones."""


def can_be_drawn() -> bool:
    """True if figures can be drawn."""
    return find_spec("matplotlib") is not None


def write(
    folder: Path,
    rows: StudyTable,
    summary: Mapping[str, Any],
    requested: tuple[int, int],
    source: str,
    figure_format: str = "svg",
) -> list[Path]:
    """Write the page and its figures into a folder; returns both forms of the page.

    Parameters
    ----------
    folder : Path
        Exists.
    rows : StudyTable
    summary : mapping
        `statistics.summary` of the rows.
    requested : two int
        Requested rows, and rows of the study.
    source : str
        Name of the study on the command line.
    figure_format : str
        Format of the figures in addition to SVG.

    Raises
    ------
    SpheretwinError
        A file cannot be written there.
    """
    study, command = rows.study, f"spheretwin sweep {shlex.quote(source)}"
    shown_rows = conclusion.in_mrad(rows)
    sections = [
        PageSection("Metrics of the rows", [medians(summary)]),
        *pieces.figures_section(drawings(shown_rows)),
        *conditions.section(rows),
        *_worst(shown_rows, command),
        *_failures(rows),
        PageSection("Varied fields", [_axes(study, rows)]),
    ]
    limit = f" --limit {requested[0]}" if requested[0] < requested[1] else ""
    conclusions = f"**Conclusion.** {conclusion.text(rows, summary)}"
    lead = "\n".join([study["description"], "", conclusions, "", _ends(rows, *requested)])
    return ReportPage(NAME, study["name"], lead, sections, command + limit).write(folder, figure_format)


def _ends(rows: StudyTable, of: int, total: int) -> str:
    """Number of the rows and their statuses."""
    count = len(rows.laws)
    ends = ", ".join(f"{number} {status}" for status, number in Counter(rows.statuses.tolist()).items())
    missing = f" {of - count} rows remain: the same command continues." if count < of else ""
    first = f" Only {of} of the study's {total} rows were requested." if of < total else ""
    return f"{count} of {of} rows: {ends or 'none'}.{missing}{first}"


def medians(summary: Mapping[str, Any], title: str = "") -> ResultTable:
    """Table: of each figure median, its 95 % interval and range, then the statuses."""
    figures = [name for name in next(iter(summary.values()), {}) if name != "statuses"]
    statuses = sorted({status for of_law in summary.values() for status in of_law["statuses"]})
    body = [
        [
            quantity_text(conclusion.mrad_name(name)),
            *(conclusion.spread_text(of_law[name], conclusion.factor(name)) for of_law in summary.values()),
        ]
        for name in figures
    ]
    body += [
        [f"number of rows: {name}", *(str(of_law["statuses"].get(name, 0)) for of_law in summary.values())]
        for name in statuses
    ]
    return ResultTable(
        title, ["median [its 95 % interval] (95 % range) of the completed rows", *summary], body
    )


def _worst(rows: StudyTable, command: str) -> list[PageSection]:
    """Completed rows with the largest main figure, and the command that runs each alone."""
    if rows.main is None:
        return []
    values = np.where(rows.completed, rows.figures[rows.main], np.nan)
    order = [place for place in np.argsort(-values, kind="stable") if np.isfinite(values[place])]
    if not order:
        return []
    body = [
        [str(rows.numbers[place]), f"`{rows.keys[place]}`", rows.laws[place], f"{values[place]:.4g}"]
        for place in order[:MOST_NAMED]
    ]
    table = ResultTable("", ["row", "key", "law", _quantity(rows)], body, 0, ["key", "law"])
    alone = f"`{command} --row KEY` runs one row and prints its command line."
    return [PageSection("Completed rows with the largest value", [table, alone])]


def _failures(rows: StudyTable) -> list[PageSection]:
    """Rows that did not complete by status and reason, with the first of each kind."""
    by_kind: dict[tuple[str, str, str], list[int]] = {}
    for place in np.flatnonzero(~rows.completed).tolist():
        by_kind.setdefault((rows.laws[place], rows.statuses[place], rows.complaints[place]), []).append(place)
    if not by_kind:
        return []
    kinds = sorted(by_kind.items(), key=lambda kind: -len(kind[1]))
    body = [
        [
            law,
            status,
            complaint and shown(complaint).strip("'\""),
            str(len(places)),
            f"`{rows.keys[places[0]]}`",
        ]
        for (law, status, complaint), places in kinds[: 2 * MOST_NAMED]
    ]
    head = ["law", "status", "reason", "rows", "first row"]
    rest = f"And {len(kinds) - len(body)} other reasons." if len(kinds) > len(body) else ""
    return [PageSection("Rows that did not complete", [ResultTable("", head, body, 3, head[-1:]), rest])]


def _axes(study: Mapping[str, Any], rows: StudyTable) -> ResultTable | str:
    """Axes with the values of the finished rows."""
    if not study["axis"]:
        return "Only the seed differs."
    fields = [axis["field"] for axis in study["axis"]]
    body = [
        [quantity_text(field), axis["kind"], _range(rows.axes[field]), f"`{field}`"]
        for field, axis in zip(fields, study["axis"], strict=True)
    ]
    return ResultTable("", ["quantity", "kind", "values", "field"], body, 4)


def _range(values: Any) -> str:
    """Short list of the values of an axis in the table."""
    distinct = list(dict.fromkeys(values.tolist()))
    if values.dtype != np.float64:
        listed = ", ".join(str(value) for value in distinct[:MOST_NAMED])
        return shown(listed).strip("'\"") + (", …" if len(distinct) > MOST_NAMED else "")
    if len(distinct) <= MOST_NAMED:
        return ", ".join(f"{value:.6g}" for value in distinct)
    return f"{len(distinct)} from {np.nanmin(values):.6g} to {np.nanmax(values):.6g}"
