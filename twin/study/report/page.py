"""What a study found as one page: Markdown, HTML of the same content, and the figures."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from spheretwin.models.base.wording import shown
from spheretwin.twin.study.report.drawings import drawings
from spheretwin.twin.study.report.reading import Rows
from spheretwin.viz.figures.drawing import Drawing
from spheretwin.viz.page import html
from spheretwin.viz.page import markdown as pieces
from spheretwin.viz.page.folder import save_drawings, save_text

MARKDOWN, HTML = "report.md", "report.html"

MOST_NAMED = 5
"""Rows that are named one by one, the worst of them and those that failed."""


def can_be_drawn() -> bool:
    """Whether there is what figures are drawn with."""
    return find_spec("matplotlib") is not None


def write(
    folder: Path,
    rows: Rows,
    told: Mapping[str, Any],
    wanted: tuple[int, int],
    source: str,
    versions: Mapping[str, str],
) -> list[Path]:
    """Write the page and its figures into a folder; returns both forms of the page.

    Parameters
    ----------
    folder : Path
        Exists.
    rows : Rows
    told : mapping
        Their summary.
    wanted : two int
        Rows that were wanted, and all that the study has.
    source : str
        The study as the command line names it.
    versions : mapping
        Version by package, for the foot.

    Raises
    ------
    SpheretwinError
        A file cannot be written there.
    """
    drawn = list(drawings(rows))
    save_drawings(folder, drawn)
    text = markdown(rows, told, wanted, drawn, source, versions)
    title = str(rows.study["name"])
    return [save_text(folder / MARKDOWN, text), save_text(folder / HTML, html.page(title, text))]


def markdown(
    rows: Rows,
    told: Mapping[str, Any],
    wanted: tuple[int, int],
    drawn: Sequence[Drawing],
    source: str,
    versions: Mapping[str, str],
) -> str:
    """Text of the page."""
    study, command = rows.study, f"spheretwin sweep {shlex.quote(source)}"
    used = ", ".join(f"{name} {version}" for name, version in versions.items())
    lines = [f"# {study['name']}", "", study["description"], "", _ends(rows, *wanted), ""]
    lines += ["## Figures of the rows", "", *_summary(told), ""]
    lines += [pieces.figure(drawing) for drawing in drawn]
    lines += _worst(rows, command)
    lines += _failures(rows)
    lines += ["## What differs from row to row", "", *_axes(study, rows), ""]
    limit = f" --limit {wanted[0]}" if wanted[0] < wanted[1] else ""
    lines += [f"Made by `{command}{limit}` with {used}.", ""]
    return "\n".join(lines)


def _ends(rows: Rows, of: int, whole: int) -> str:
    """How many rows there are, and how they ended."""
    count = len(rows.laws)
    ends = ", ".join(f"{number} {status}" for status, number in Counter(rows.statuses.tolist()).items())
    missing = f" The other {of - count} are still to be run: the same command goes on." if count < of else ""
    first = f" Only {of} of the study's {whole} rows were requested." if of < whole else ""
    return f"{count} of {of} rows: {ends or 'none'}.{missing}{first}"


def _summary(told: Mapping[str, Any]) -> list[str]:
    """Median and 95 % range of each figure, a column a law; below them the statuses."""
    figures = [name for name in next(iter(told.values()), {}) if name != "statuses"]
    statuses = sorted({status for of_law in told.values() for status in of_law["statuses"]})
    body = [[name, *(_spread(of_law[name]) for of_law in told.values())] for name in figures]
    body += [[name, *(str(of_law["statuses"].get(name, 0)) for of_law in told.values())] for name in statuses]
    head = ["median (95 % range) of the completed rows", *told]
    return pieces.table(head, body, [False, *(True for _ in told)])


def _spread(figure: Mapping[str, Any]) -> str:
    if figure["median"] is None:
        return "–"
    low, high = figure["range_95"]
    return f"{figure['median']:.4g} ({low:.4g} to {high:.4g})"


def _worst(rows: Rows, command: str) -> list[str]:
    """Completed rows with the largest main figure, and how each is run alone."""
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
    head = ["row", "key", "law", rows.main]
    table = pieces.table(head, body, [True, False, False, True])
    alone = f"`{command} --row KEY` runs one alone, and prints the command line that does."
    return ["## The worst that were completed", "", *table, "", alone, ""]


def _failures(rows: Rows) -> list[str]:
    """Rows by how they ended, where that was not their end, with the first of each kind."""
    found: dict[tuple[str, str, str], list[int]] = {}
    for place in np.flatnonzero(~rows.completed).tolist():
        found.setdefault((rows.laws[place], rows.statuses[place], rows.complaints[place]), []).append(place)
    if not found:
        return []
    kinds = sorted(found.items(), key=lambda each: -len(each[1]))
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
    table = pieces.table(
        ["law", "status", "why", "rows", "the first"], body, [False, False, False, True, False]
    )
    rest = [f"And {len(kinds) - len(body)} other reasons.", ""] if len(kinds) > len(body) else []
    return ["## Rows that did not come to their end", "", *table, "", *rest]


def _axes(study: Mapping[str, Any], rows: Rows) -> list[str]:
    """Axes, as they are in the rows that there are."""
    if not study["axis"]:
        return ["Nothing but the seed."]
    body = [[f"`{axis['field']}`", axis["kind"], _range(rows.axes[axis["field"]])] for axis in study["axis"]]
    return pieces.table(["field", "values", ""], body, [False, False, False])


def _range(values: Any) -> str:
    """What an axis has in the table, in a few words."""
    distinct = list(dict.fromkeys(values.tolist()))
    if values.dtype != np.float64:
        listed = ", ".join(str(each) for each in distinct[:MOST_NAMED])
        return shown(listed).strip("'\"") + (", …" if len(distinct) > MOST_NAMED else "")
    if len(distinct) <= MOST_NAMED:
        return ", ".join(f"{each:.6g}" for each in distinct)
    return f"{len(distinct)} from {np.nanmin(values):.6g} to {np.nanmax(values):.6g}"
