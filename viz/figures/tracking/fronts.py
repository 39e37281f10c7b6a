"""Figure of errors over what they cost: a panel a condition, a line a law, both axes logarithmic."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator
from numpy.typing import NDArray

from spheretwin.viz.figures.plots import FAINT, WIDTH_in
from spheretwin.viz.figures.tracking.style import Style, styles

Array = NDArray[np.float64]

MARGIN = 1.15
SIZES = {"*": 9.0}
"""Of markers that look smaller than others."""

MOST = 40.0
"""Largest error that is drawn, over the least."""


class Panel(NamedTuple):
    """One condition."""

    title: str
    error: str
    by_law: Mapping[str, Array]  # (n, 2) cost and error
    marked: Mapping[str, tuple[str, float, float]]  # by name: law, cost and error
    floors: Sequence[float] = ()  # errors that no cost avoids


def fronts(panels: Sequence[Panel], labels: Mapping[str, str], cost: str) -> Figure:
    """Draw the panels side by side.

    Parameters
    ----------
    panels : sequence of Panel
    labels : mapping of law to label
    cost : str
        Label of the axis.
    """
    figure = Figure(figsize=(0.65 * WIDTH_in * max(len(panels), 2), 5.2), layout="constrained")
    grid = figure.subplots(1, max(len(panels), 1), squeeze=False)
    looks = styles(list(labels))
    for axes, panel in zip(grid.flat, panels, strict=False):
        _panel(axes, panel, looks)
        axes.set_xlabel(cost)
    handles = [
        grid.flat[0].plot([], [], style.marker, markersize=_size(style), label=labels[law], **style.line())[0]
        for law, style in looks.items()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=5, frameon=False, handlelength=3.2)
    return figure


def _panel(axes: Axes, panel: Panel, looks: Mapping[str, Style]) -> None:
    for floor in panel.floors:
        axes.axhline(floor, color=FAINT, linewidth=1.0, zorder=1)
    for law, values in panel.by_law.items():
        style = looks[law]
        axes.plot(*values[np.argsort(values[:, 0])].T, style.marker, markersize=_size(style), linewidth=1.3,
                  markeredgewidth=0.4, markeredgecolor="white", zorder=3, **style.line())  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")
    _set_limits(axes, panel)
    for name, (law, x, y) in panel.marked.items():
        if x <= axes.get_xlim()[1] and y <= axes.get_ylim()[1]:
            style = looks[law]
            axes.plot(x, y, style.marker, color=style.colour, markersize=1.5 * _size(style),
                      markerfacecolor="white", zorder=5)  # fmt: skip
            axes.annotate(name, (x, y), (-9, -1), textcoords="offset points", ha="right", va="center",
                          fontsize="small", zorder=5)  # fmt: skip
    axes.set_ylabel(panel.error)
    axes.set_title(panel.title, fontsize="medium")
    axes.grid(visible=True, color=FAINT, alpha=0.25, linewidth=0.5)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _set_limits(axes: Axes, panel: Panel) -> None:
    """Show everything within `MOST` times the least error."""
    marked = np.array([(x, y) for _, x, y in panel.marked.values()]).reshape(-1, 2)
    points = np.concatenate([marked, *panel.by_law.values()])
    if not len(points):
        return
    near = points[points[:, 1] <= MOST * points[:, 1].min()]
    least = min([near[:, 1].min(), *panel.floors])
    axes.set_xlim(near[:, 0].min() / MARGIN, near[:, 0].max() * MARGIN)
    axes.set_ylim(least / MARGIN, near[:, 1].max() * MARGIN)
    for axis in (axes.xaxis, axes.yaxis):
        low, high = axis.get_view_interval()
        steps = (1, 2, 5) if high > 10 * low else (1, 1.5, 2, 3, 4, 5, 6, 7, 8, 9)
        ticks = [step * 10.0**power for power in range(-4, 5) for step in steps]
        axis.set_major_locator(FixedLocator([tick for tick in ticks if low <= tick <= high]))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_locator(NullLocator())


def _size(style: Style) -> float:
    return SIZES.get(style.marker, 6.0)
