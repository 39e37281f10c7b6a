"""Runs as figures for print, and as one page with plots that are moved: for those without a viewer."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spheretwin.twin.review.beside.merging import beside
from spheretwin.twin.review.run import Reviewed
from spheretwin.twin.review.spectrum import amplitudes, peaks
from spheretwin.viz.compared.desired import leaders
from spheretwin.viz.compared.quantities import Quantity, drawn
from spheretwin.viz.compared.run import Run
from spheretwin.viz.compared.spectrum import Spectrum
from spheretwin.viz.page import folder, markdown
from spheretwin.viz.terminal.reviews import differences as table_rows

if TYPE_CHECKING:
    from spheretwin.viz.figures.drawing import Drawing

PAGE = "review.html"

TITLES = {
    "whole": "Tracking error as one angle",
    "error": "Tracking error of each hinge",
    "angle": "Hinge angles and what was asked for",
    "sliding": "Sliding variables",
    "effort": "Torque and current",
    "more": "Torque that arrives",
}
"""Of the figure of each group of quantities."""


def write(runs: Sequence[Reviewed], told: Sequence[dict[str, Any]], into: Path) -> Path:
    """Write figures and page into a folder; returns the page's path.

    Parameters
    ----------
    runs : sequence of Reviewed
    told : sequence of mapping
        What a review tells of each.
    into : Path
        A folder that takes files.

    Raises
    ------
    InputError
        A run has no rows, or a file cannot be written there.
    """
    from spheretwin.viz.page.interactive import drawing, page  # what draws is slow to import

    compared = beside(runs, every_tick=True)
    tables = [run.table for run in compared]
    leading, quantities = leaders(tables), drawn(tables)
    spectra = [_spectra(run) for run in runs]
    title = compared[0].label if len(runs) == 1 else f"{len(runs)} runs"
    with np.errstate(all="ignore"):  # what damage leaves of numbers may be of any size
        folder.save_drawings(into, _drawings(compared, leading, quantities, spectra), vector=True)
        over_time = drawing.over_time(compared, leading, quantities)
    content = page.page(
        title,
        compared,
        over_time,
        drawing.of_errors(compared, spectra),
        _above(title, compared, drawing.points_each(compared, leading, quantities)),
        _below(compared, told),
    )
    return folder.save_text(into / PAGE, content)


def check(into: Path) -> None:
    """Find out whether all can be drawn and written, and leave an empty folder.

    Raises
    ------
    InputError
        What draws is not installed, or the folder cannot be made or written to.
    """
    folder.prepare(into, "plotly")


def _drawings(
    runs: Sequence[Run],
    leading: Sequence[int],
    quantities: Sequence[Quantity],
    spectra: Sequence[list[Spectrum]],
) -> Iterator[Drawing]:
    from spheretwin.viz.figures.compared.currents import currents
    from spheretwin.viz.figures.compared.happened import happened
    from spheretwin.viz.figures.compared.over_time import over_time
    from spheretwin.viz.figures.compared.spectra import spectra as of_errors
    from spheretwin.viz.figures.drawing import Drawing

    for group, inside in groupby(quantities, key=lambda each: each.group):
        title = TITLES[group]
        yield Drawing(f"{group}.png", title, over_time(runs, leading, list(inside), title))
    yield Drawing("currents.png", title := "Currents of all groups", currents(runs, title))
    yield Drawing("spectra.png", title := "Spectra of the tracking errors", of_errors(runs, spectra, title))
    yield Drawing("events.png", title := "What happened", happened(runs, title))


def _spectra(run: Reviewed) -> list[Spectrum]:
    return [
        Spectrum(*amplitudes(column, run.period_s), [(peak.frequency_Hz, peak.amplitude) for peak in
                 peaks(column, run.period_s)])
        for column in 1e3 * run.every_tick["error_rad"].T
    ]  # fmt: skip


def _above(title: str, runs: Sequence[Run], most: int) -> str:
    thin = any(len(run.table) > most for run in runs)
    lines = [
        f"# {_plain(title)}",
        "",
        "Drag to zoom, double-click to see all again; what is at the cursor is told in every plot. The"
        " buttons switch runs. The wide grey line is what was asked for.",
    ]
    if thin:
        lines.append("Long runs are drawn by the lowest and the highest of every few ticks.")
    return "\n".join(lines)


def _below(runs: Sequence[Run], told: Sequence[dict[str, Any]]) -> str:
    head = ["differences from run 1" if len(runs) > 1 else "", *(_plain(run.label) for run in runs)]
    rows = [[cell.replace("\n", "; ") for cell in row] for row in table_rows(told)]
    return "\n".join(["## Figures", "", *markdown.table(head, rows, [False] + [True] * len(runs))])


def _plain(text: str) -> str:
    """Text in which no sign is markup."""
    return "".join(f"\\{sign}" if sign in "\\`*_{}[]<>#|!" else sign for sign in text)
