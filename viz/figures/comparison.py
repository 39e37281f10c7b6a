"""Runs over time: angles, errors and largest current of one, currents of all groups of several."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import Level
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.comparison.runs import (
    ComparedRun,
    LogarithmicRange,
    PlotRange,
    Spectrum,
    logarithmic_range,
    quantity_ranges,
)
from spheretwin.viz.decimation import mean_and_deviation, octave_maxima
from spheretwin.viz.figures.style import (
    AXES,
    BROKEN,
    DASHES,
    DPI,
    FAINT,
    INK,
    MOST_BINS,
    REFERENCE,
    draw_line,
    legend_below,
    name_runs,
    plain,
    run_styles,
    sheet,
)
from spheretwin.viz.quantities import Quantity

MOST_CELLS = 200
"""Cells of a row of an image."""

LEGEND_ROW_in = 0.16


class Detail(NamedTuple):
    """Detail of the lines of a figure."""

    points: int = MOST_BINS
    """Points up to which every tick is drawn."""
    bins: int = MOST_BINS
    """Bins of a line with more ticks."""


PRINT = Detail()


def currents(runs: Sequence[ComparedRun], title: str, most_cells: int = MOST_CELLS) -> Figure:
    """Draw the mean of each cell on one scale, blue negative and red positive; below it a lane of variation.

    The variation is the standard deviation of the ticks within a cell, of the group where it is largest.

    Parameters
    ----------
    runs : sequence of ComparedRun
    title : str
    most_cells : int
        Cells of a row.
    """
    ratios = [7, 1] * len(runs)
    figure, grid = sheet(1.2 + 2.3 * len(runs), 2 * len(runs), title=title, sharex=True, height_ratios=ratios)
    panels = grid[:, 0]
    largest_A = max(float(np.nanmax(np.abs(run.table["current_A"]))) for run in runs) or 1.0
    scale = {"cmap": "RdBu_r", "vmin": -largest_A, "vmax": largest_A}
    lane_scale = {"cmap": "Greys", "vmin": 0.0, "vmax": largest_A / 2}
    for panel, lane, run in zip(panels[::2], panels[1::2], runs, strict=True):
        cells = mean_and_deviation(run.table["current_A"], most_cells)
        groups, t_s = cells.mean.shape[1], run.table["t_s"]
        edges_s = np.append(t_s[cells.starts], t_s[-1] + run.period_s)
        label = f"_{run.legend}"
        means = panel.pcolormesh(edges_s, np.arange(groups + 1) - 0.5, cells.mean.T, label=label, **scale)
        variation = np.max(cells.deviation, axis=1)[None]
        deviations = lane.pcolormesh(edges_s, [0.0, 1.0], variation, label=label, **lane_scale)
        panel.set_ylim(groups - 0.5, -0.5)
        panel.set_ylabel("group", fontsize="small")
        panel.set_yticks(range(0, groups, max(1, groups // 6)))
        panel.tick_params(labelsize="small")
        panel.set_title(f"mean currents of {run.legend}", fontsize="small", loc="left")
        lane.set_yticks([0.5], ["variation"], fontsize="small")
    panels[-1].set_xlabel("time, s")
    bar: dict[str, Any] = {"shrink": 0.9, "aspect": 30}
    figure.colorbar(means, ax=list(panels), label="mean current of a cell, A", **bar)
    figure.colorbar(deviations, ax=list(panels), label="standard deviation within a cell, A", **bar)
    return figure


MARKS = {Level.INFO: ("|", INK), Level.WARN: ("^", "#b07848"), Level.ERROR: ("X", BROKEN)}


def events_figure(runs: Sequence[ComparedRun], title: str) -> Figure:
    """Draw them over time; a line is as long as its run.

    Parameters
    ----------
    runs : sequence of ComparedRun
    title : str
    """
    figure, ((axes,),) = sheet(1.5 + 0.45 * len(runs), title=title)
    for row, (run, look) in enumerate(zip(runs, run_styles(runs), strict=True)):
        t_s = run.table["t_s"]
        axes.plot([t_s[0], t_s[-1]], [row, row], color=look.colour, linewidth=2.5, alpha=0.6)
        for level, (mark, colour) in MARKS.items():
            times = [event[0] for event in run.events if event[1] == level]
            axes.plot(times, [row] * len(times), mark, color=colour, markersize=8)
    for level, (mark, colour) in MARKS.items():
        axes.plot([], [], mark, color=colour, markersize=8, linestyle="", label=level.value.lower())
    axes.set_yticks(range(len(runs)), [run.label for run in runs])
    axes.set_ylim(len(runs) - 0.5, -0.5)
    plain(axes, "")
    axes.grid(visible=True, axis="x", color=FAINT, alpha=0.35)
    axes.set_xlabel("time, s")
    legend_below(figure, [axes], 3, fontsize="small")
    return figure


LINES_EACH_OCTAVE = 64


def spectra(
    runs: Sequence[ComparedRun], of_runs: Sequence[Sequence[Spectrum]], title: str,
    each_octave: int = LINES_EACH_OCTAVE,
) -> Figure:  # fmt: skip
    """Draw them, both axes logarithmic.

    Parameters
    ----------
    runs : sequence of ComparedRun
    of_runs : sequence of sequence of Spectrum
        Spectra of each run and each hinge.
    title : str
    each_octave : int
        Lines of each octave.
    """
    figure, grid = sheet(7.0, len(ANGLES), title=title, sharex=True)
    panels = grid[:, 0]
    for axis, (panel, name) in enumerate(zip(panels, ANGLES, strict=True)):
        panel.set(xscale="log", yscale="log")
        for run, look, of_run in zip(runs, run_styles(runs), of_runs, strict=True):
            spectrum = of_run[axis]
            lines = octave_maxima(spectrum.frequency_Hz, spectrum.amplitude_mrad, each_octave)
            panel.plot(*lines, label=run.label, **look.line())
            for frequency_Hz, amplitude_mrad in spectrum.peaks:
                panel.plot(
                    frequency_Hz, amplitude_mrad, "o", color=look.colour, markersize=4, label=f"_{run.label}"
                )
        plain(panel, f"error of {name},\namplitude, mrad")
    panels[-1].set_xlabel("frequency, Hz")
    name_runs(figure, panels[0])
    return figure


def over_time(
    runs: Sequence[ComparedRun], leading: Sequence[int], quantities: Sequence[Quantity], title: str,
    detail: Detail = PRINT,
) -> Figure:  # fmt: skip
    """Draw quantities over time; the reference is a thin dark line over the others.

    A run with more ticks than the figure has dots is drawn by the bounds and the mean of every few ticks. The
    range is that of the settled runs; the panel states the values outside. Errors as one angle are drawn once
    more on a logarithmic axis.

    Parameters
    ----------
    runs : sequence of ComparedRun
    leading : sequence of int
        Places of the runs that show the reference.
    quantities : sequence of Quantity
    title : str
    detail : Detail
    """
    panels_of = [(quantity, False) for quantity in quantities]
    panels_of += [(quantity, True) for quantity in quantities if quantity.group == "whole"]
    height_in = 1.3 + 1.75 * len(panels_of) + LEGEND_ROW_in * len(runs)
    figure, grid = sheet(height_in, len(panels_of), title=title, sharex=True)
    panels = grid[:, 0]
    ranges = dict(zip(quantities, quantity_ranges(quantities, runs, leading), strict=True))
    for panel, (quantity, logarithmic) in zip(panels, panels_of, strict=True):
        of_runs = [quantity.column(run.rows) for run in runs]
        if logarithmic:
            panel.set_yscale("log")
            of_runs = [np.where(values > 0, values, np.nan) for values in of_runs]
            limits = _stated_range(panel, logarithmic_range(of_runs))
        else:
            limits = _stated_range(panel, ranges[quantity])
        for run, of_run, values in zip(runs, run_styles(runs), of_runs, strict=True):
            draw_line(panel, run.table["t_s"], values, *detail, label=run.legend, **of_run.line())
            if run.early_end:
                _mark_end(panel, run, values, limits, of_run.colour)
        for place in leading:
            if quantity.desired:
                name = "reference" if len(leading) == 1 else f"reference of {runs[place].label}"
                t_s, desired = runs[place].table["t_s"], quantity.desired(runs[place].rows)
                draw_line(panel, t_s, desired, *detail, label=name, **REFERENCE)
        panel.set_ylim(*limits)
        unit = f"{quantity.unit}, logarithmic" if logarithmic else quantity.unit
        plain(panel, f"{quantity.title},\n{unit}")
    panels[-1].set_xlabel("time, s")
    name_runs(figure, panels[0])
    return figure


def _stated_range(panel: Axes, limits: PlotRange | LogarithmicRange) -> tuple[float, float]:
    """Return the range of a panel, and state in its title the values outside."""
    if lines := limits.outside_lines():
        panel.set_title("\n".join(lines), fontsize="x-small", loc="right")
    return limits.low, limits.high


def _mark_end(panel: Axes, run: ComparedRun, values: Array, limits: tuple[float, float], colour: str) -> None:
    """Mark the end of a run that is not complete at its last value, within the range."""
    finite = values[np.isfinite(values)]
    if len(finite):
        last = np.clip(finite[-1], *limits)
        panel.plot(run.table["t_s"][-1], last, "X", color=colour, label=f"_{run.legend}", markersize=8,
                   markeredgecolor=INK, clip_on=False, zorder=5)  # fmt: skip


def overview(table: Table, title: str) -> Figure:
    """Draw a run: hinge angles with their references, tracking errors, largest current of all groups.

    Parameters
    ----------
    table : Table
        Telemetry with at least one row.
    title : str
    """
    figure, grid = sheet(6.0, 3, title=title, sharex=True)
    angles, errors, currents = grid[:, 0]
    t_s = table["t_s"]
    for i, (name, colour) in enumerate(zip(ANGLES, AXES, strict=True)):
        look = {"color": colour, "linestyle": DASHES[i], "linewidth": 1.1}
        for panel, values in (
            (angles, np.degrees(table["q_rad"][:, i])),
            (errors, 1e3 * table["error_rad"][:, i]),
        ):
            draw_line(panel, t_s, values, label=name, **look)
    for i in range(len(ANGLES)):
        label = None if i else "references"
        draw_line(angles, t_s, np.degrees(table["q_ref_rad"][:, i]), label=label, **REFERENCE)
    largest = np.abs(table["current_A"]).max(axis=1)
    draw_line(currents, t_s, largest, color=INK, linewidth=1.1)
    for panel, heading in ((angles, "angle, °"), (errors, "error, mrad"), (currents, "largest current, A")):
        plain(panel, heading)
    legend_below(figure, [angles], loc="outside lower left", fontsize="small")
    currents.set_xlabel("time, s")
    return figure


def as_html(figure: Figure) -> str:
    """Return an image element that holds the figure as PNG."""
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=DPI / 2, metadata={"Software": None})
    data = base64.b64encode(content.getvalue()).decode()
    return f'<img alt="plots of the run" src="data:image/png;base64,{data}">'
