"""Currents of all groups over time: a panel a run, a row a group."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from spheretwin.viz.compared.run import Run
from spheretwin.viz.compared.thinning import strongest
from spheretwin.viz.figures.plots import WIDTH_in

MOST_COLUMNS = 1000


def currents(runs: Sequence[Run], title: str) -> Figure:
    """Draw them on one scale: blue is negative, red positive.

    Parameters
    ----------
    runs : sequence of Run
    title : str
    """
    figure = Figure(figsize=(WIDTH_in, 1.2 + 2.3 * len(runs)), layout="constrained")
    panels = figure.subplots(len(runs), 1, sharex=True, squeeze=False)[:, 0]
    largest_A = max(float(np.nanmax(np.abs(run.table["current_A"]))) for run in runs) or 1.0
    for panel, run in zip(panels, runs, strict=True):
        few = strongest(run.table["current_A"], MOST_COLUMNS)
        groups = few.values.shape[1]
        start_s = float(run.table["t_s"][0])
        end_s = start_s + run.period_s * few.rows_each * len(few.values)
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
