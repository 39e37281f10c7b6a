"""Currents of all groups over time: a panel a run, a row a group."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import Level
from spheretwin.viz.comparison.runs import ComparedRun, Spectrum
from spheretwin.viz.decimation import decimate_extremes, decimate_largest, octave_maxima
from spheretwin.viz.figures.style import (
    BROKEN,
    FAINT,
    INK,
    MOST_POINTS,
    WIDTH_in,
    name_runs,
    panel_column,
    plain,
    run_styles,
)
from spheretwin.viz.quantities import Array, ScalarQuantity

MOST_COLUMNS = 1000


def currents(runs: Sequence[ComparedRun], title: str) -> Figure:
    """Draw them on one scale: blue is negative, red positive.

    Parameters
    ----------
    runs : sequence of ComparedRun
    title : str
    """
    figure = Figure(figsize=(WIDTH_in, 1.2 + 2.3 * len(runs)), layout="constrained")
    panels = panel_column(figure, len(runs))
    largest_A = max(float(np.nanmax(np.abs(run.table["current_A"]))) for run in runs) or 1.0
    for panel, run in zip(panels, runs, strict=True):
        few = decimate_largest(run.table["current_A"], MOST_COLUMNS)
        groups = few.values.shape[1]
        start_s = float(run.table["t_s"][0])
        end_s = start_s + run.period_s * few.stride * len(few.values)
        place = (start_s, end_s, groups - 0.5, -0.5)
        scale = {"cmap": "RdBu_r", "vmin": -largest_A, "vmax": largest_A, "interpolation": "nearest"}
        image = panel.imshow(few.values.T, extent=place, aspect="auto", **scale)
        panel.set_ylabel("group", fontsize="small")
        panel.set_yticks(range(0, groups, max(1, groups // 6)))
        panel.tick_params(labelsize="small")
        panel.set_title(run.label, fontsize="small", loc="left")
    ends_s = [float(run.table["t_s"][-1]) for run in runs]
    panels[-1].set_xlim(min(float(run.table["t_s"][0]) for run in runs), max(ends_s) + runs[0].period_s)
    panels[-1].set_xlabel("time, s")
    figure.colorbar(image, ax=list(panels), label="current, A", shrink=0.9, aspect=30)
    figure.suptitle(title, fontsize="medium")
    return figure


MARKS = {Level.INFO: ("|", INK), Level.WARN: ("^", "#b07848"), Level.ERROR: ("X", BROKEN)}


def events_figure(runs: Sequence[ComparedRun], title: str) -> Figure:
    """Draw them over time; a line is as long as its run.

    Parameters
    ----------
    runs : sequence of ComparedRun
    title : str
    """
    figure = Figure(figsize=(WIDTH_in, 1.5 + 0.45 * len(runs)), layout="constrained")
    axes = figure.subplots()
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
    axes.set_title(title, fontsize="medium")
    figure.legend(loc="outside lower center", ncols=3, frameon=False, fontsize="small")
    return figure


LINES_EACH_OCTAVE = 64


def spectra(runs: Sequence[ComparedRun], of_runs: Sequence[Sequence[Spectrum]], title: str) -> Figure:
    """Draw them, both axes logarithmic.

    Parameters
    ----------
    runs : sequence of ComparedRun
    of_runs : sequence of sequence of Spectrum
        Spectra of each run and each hinge.
    title : str
    """
    figure = Figure(figsize=(WIDTH_in, 7.0), layout="constrained")
    panels = panel_column(figure, len(ANGLES))
    for axis, (panel, name) in enumerate(zip(panels, ANGLES, strict=True)):
        panel.set_xscale("log")
        panel.set_yscale("log")
        for run, look, of_run in zip(runs, run_styles(runs), of_runs, strict=True):
            spectrum = of_run[axis]
            lines = octave_maxima(spectrum.frequency_Hz, spectrum.amplitude_mrad, LINES_EACH_OCTAVE)
            panel.plot(*lines, label=run.label, **look.line())
            for frequency_Hz, amplitude_mrad in spectrum.peaks:
                panel.plot(frequency_Hz, amplitude_mrad, "o", color=look.colour, markersize=4)
        plain(panel, f"error of {name},\namplitude, mrad")
    panels[0].set_title(title, fontsize="medium")
    panels[-1].set_xlabel("frequency, Hz")
    name_runs(figure, panels[0])
    return figure


def over_time(
    runs: Sequence[ComparedRun], leading: Sequence[int], quantities: Sequence[ScalarQuantity], title: str
) -> Figure:
    """Draw quantities over time; the reference is a thin dark line over the others.

    Parameters
    ----------
    runs : sequence of ComparedRun
    leading : sequence of int
        Places of the runs that show the reference.
    quantities : sequence of Quantity
    title : str
    """
    figure = Figure(figsize=(WIDTH_in, 1.3 + 1.75 * len(quantities)), layout="constrained")
    panels = panel_column(figure, len(quantities))
    for panel, quantity in zip(panels, quantities, strict=True):
        for run, of_run in zip(runs, run_styles(runs), strict=True):
            _draw(panel, run, quantity.values(run.rows), label=run.label, **of_run.line())
        for place in leading:
            if quantity.desired:
                name = "reference" if len(leading) == 1 else f"reference of {runs[place].label}"
                look = {"label": name, "color": INK, "linewidth": 0.7, "linestyle": (0, (4, 3))}
                _draw(panel, runs[place], quantity.desired(runs[place].rows), **look)
        if quantity.limits:
            panel.set_ylim(*quantity.limits)
        plain(panel, quantity.heading.replace(" [", ",\n").removesuffix("]"))
    panels[0].set_title(title, fontsize="medium")
    panels[-1].set_xlabel("time, s")
    name_runs(figure, panels[0])
    return figure


def _draw(panel: Axes, run: ComparedRun, values: Array, **look: Any) -> None:
    few, start_s = decimate_extremes(values, MOST_POINTS), run.table["t_s"][0]
    t_s = start_s + run.period_s * few.stride * np.arange(len(few.values))
    panel.plot(t_s, few.values, **look)
