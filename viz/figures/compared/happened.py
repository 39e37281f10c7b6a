"""What happened in runs: a row a run, a mark an event, by its level."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from spheretwin.models.telemetry.status import Level
from spheretwin.viz.compared.run import Run
from spheretwin.viz.figures.compared.style import looks, plain
from spheretwin.viz.figures.plots import BROKEN, FAINT, INK, WIDTH_in

MARKS = {Level.INFO: ("|", INK), Level.WARN: ("^", "#e69f00"), Level.ERROR: ("X", BROKEN)}


def happened(runs: Sequence[Run], title: str) -> Figure:
    """Draw them over time; a line is as long as its run.

    Parameters
    ----------
    runs : sequence of Run
    title : str
    """
    figure = Figure(figsize=(WIDTH_in, 1.5 + 0.45 * len(runs)), layout="constrained")
    axes = figure.subplots()
    for row, (run, look) in enumerate(zip(runs, looks(runs), strict=True)):
        t_s = run.table["t_s"]
        axes.plot([t_s[0], t_s[-1]], [row, row], color=look.colour, linewidth=2.5, alpha=0.6)
        for level, (mark, colour) in MARKS.items():
            times = [each[0] for each in run.events if each[1] == level]
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
