"""Quantities of runs over time: a panel a quantity, a line a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from spheretwin.viz.compared.quantities import Quantity
from spheretwin.viz.compared.run import Run
from spheretwin.viz.compared.thinning import thinned
from spheretwin.viz.figures.compared.style import MOST_POINTS, looks, name_runs, plain
from spheretwin.viz.figures.plots import INK, WIDTH_in
from spheretwin.viz.quantities.quantity import Array


def over_time(
    runs: Sequence[Run], leading: Sequence[int], quantities: Sequence[Quantity], title: str
) -> Figure:
    """Draw them; what was asked for is a thin dark line on the others.

    Parameters
    ----------
    runs : sequence of Run
    leading : sequence of int
        Places of the runs that show what was asked for.
    quantities : sequence of Quantity
    title : str
    """
    figure = Figure(figsize=(WIDTH_in, 1.3 + 1.75 * len(quantities)), layout="constrained")
    panels = figure.subplots(len(quantities), 1, sharex=True, squeeze=False)[:, 0]
    for panel, quantity in zip(panels, quantities, strict=True):
        for run, of_run in zip(runs, looks(runs), strict=True):
            _draw(panel, run, quantity.of(run.rows), label=run.label, **of_run.line())
        for place in leading:
            if quantity.desired:
                name = "asked for" if len(leading) == 1 else f"asked for in {runs[place].label}"
                look = {"label": name, "color": INK, "linewidth": 0.7, "linestyle": (0, (4, 3))}
                _draw(panel, runs[place], quantity.desired(runs[place].rows), **look)
        if quantity.limits:
            panel.set_ylim(*quantity.limits)
        plain(panel, quantity.heading.replace(" [", ",\n").removesuffix("]"))
    panels[0].set_title(title, fontsize="medium")
    panels[-1].set_xlabel("time, s")
    name_runs(figure, panels[0])
    return figure


def _draw(panel: Axes, run: Run, values: Array, **look: Any) -> None:
    few, start_s = thinned(values, MOST_POINTS), run.table["t_s"][0]
    t_s = start_s + run.period_s * few.rows_each * np.arange(len(few.values))
    panel.plot(t_s, few.values, **look)
