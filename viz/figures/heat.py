"""Figure of numbers by row and column: each written into its square, whose colour is its size."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spheretwin.viz.figures.plots import FAINT, WIDTH_in

Array = NDArray[np.float64]

ROW_in = 0.3
DARK = 0.55  # share of the scale beyond which numbers are written in white
LEAST = 1e-3  # less has the colour of this much, and is written as it is rounded


def heat(panels: Mapping[str, Array], rows: Sequence[str], columns: Sequence[str], title: str) -> Figure:
    """Panels side by side, on one logarithmic scale of colours.

    Parameters
    ----------
    panels : mapping of title to (rows, columns) array
        What is not finite stays empty.
    rows, columns : sequence of str
    title : str
    """
    shown = np.concatenate([values.ravel() for values in panels.values()])
    most = np.max(shown, where=np.isfinite(shown), initial=10 * LEAST)
    scale = LogNorm(LEAST, most)
    figure = Figure(figsize=(1.35 * WIDTH_in, 1.6 + ROW_in * len(rows)), layout="constrained")
    sides = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axes, (name, values) in zip(sides, panels.items(), strict=True):
        axes.imshow(np.maximum(values, LEAST), norm=scale, cmap="YlOrRd", aspect="auto")
        _write(axes, values, scale)
        axes.set_xticks(range(len(columns)), columns, rotation=35, ha="right")
        axes.set_yticks(range(len(rows)), rows)
        axes.set_title(name, fontsize="medium")
        axes.tick_params(length=0)
        axes.spines[:].set_color(FAINT)
    figure.suptitle(title, fontsize="medium")
    return figure


def _write(axes: Axes, values: Array, scale: LogNorm) -> None:
    for (row, column), value in np.ndenumerate(values):
        if np.isfinite(value):
            dark = scale(max(value, LEAST)) > DARK
            axes.text(column, row, _text(value), ha="center", va="center", fontsize="small",
                      color="white" if dark else "black")  # fmt: skip


def _text(value: float) -> str:
    return f"{value:.3f}" if value < 1 else f"{value:.2f}"
