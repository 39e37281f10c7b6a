"""Figure of numbers by row and column: each written into its square, whose colour is what has changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spheretwin.viz.figures.plots import FAINT, WIDTH_in

Array = NDArray[np.float64]

ROW_in = 0.3
NEAR, FAR = 0.003, 0.1  # degrees: less change is hardly coloured, more has the full colour
TICKS = (-0.1, -0.03, -0.01, 0, 0.01, 0.03, 0.1)
MOST_BESIDE = 5  # columns of panels that have room side by side
DARK = 0.36  # distance from the middle of the scale beyond which numbers are written in white


class Panel(NamedTuple):
    """Numbers of one panel; what is no number stays empty."""

    values: Array  # (rows, columns)
    changes: Array  # (rows, columns)


def heat(
    panels: Mapping[str, Panel], rows: Sequence[str], columns: Sequence[str], title: str, change: str
) -> Figure:
    """Panels side by side, or one below the other where columns are many, on one scale of colours.

    Blue is less, red is more.

    Parameters
    ----------
    panels : mapping of title to Panel
    rows, columns : sequence of str
    title : str
    change : str
        What the colours are, with its unit.
    """
    scale = SymLogNorm(linthresh=NEAR, vmin=-FAR, vmax=FAR)
    beside = len(columns) <= MOST_BESIDE
    down, across = (1, len(panels)) if beside else (len(panels), 1)
    height_in = 1.8 + ROW_in * len(rows) * down
    figure = Figure(figsize=(1.35 * WIDTH_in, height_in), layout="constrained")
    sides = figure.subplots(down, across, sharex=not beside, sharey=beside, squeeze=False).ravel()
    for axes, (name, panel) in zip(sides, panels.items(), strict=True):
        image = axes.imshow(np.clip(panel.changes, -FAR, FAR), norm=scale, cmap="RdBu_r", aspect="auto")
        _write(axes, panel, scale)
        axes.set_xticks(range(len(columns)), columns, rotation=35, ha="right")
        axes.set_yticks(range(len(rows)), rows)
        axes.set_title(name, fontsize="medium")
        axes.tick_params(length=0)
        axes.spines[:].set_color(FAINT)
    bar = figure.colorbar(image, ax=list(sides), shrink=0.8, aspect=30, extend="both", label=change)
    bar.set_ticks(list(TICKS), labels=[f"{tick:+g}" if tick else "0" for tick in TICKS])
    bar.ax.minorticks_off()
    figure.suptitle(title, fontsize="medium")
    return figure


def _write(axes: Axes, panel: Panel, scale: SymLogNorm) -> None:
    for (row, column), value in np.ndenumerate(panel.values):
        if np.isfinite(value):
            away = abs(float(scale(np.clip(panel.changes[row, column], -FAR, FAR))) - 0.5)
            axes.text(column, row, _text(value), ha="center", va="center", fontsize="small",
                      color="white" if away > DARK else "black")  # fmt: skip


def _text(value: float) -> str:
    return f"{value:.3f}" if value < 1 else f"{value:.2f}"
