"""Figure of errors over what they cost: a panel a condition, a line a law, both axes logarithmic."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array
from spheretwin.viz.figures.style import (
    FAINT,
    INK,
    LawStyle,
    WIDTH_in,
    faint_grid,
    law_keys,
    legend_below,
    name_axes,
    plain_ticks,
    sheet,
    styles,
)
from spheretwin.viz.theme import law_colour

MARGIN = 1.15
SIZES = {"*": 9.0}
"""Sizes of markers that look smaller than others."""

MOST = 40.0
"""Largest error that is drawn, over the least."""


class FrontPanel(NamedTuple):
    """Panel of one condition."""

    title: str
    error: str
    by_law: Mapping[str, Array]  # (n, 2) cost and error
    marked: Mapping[str, tuple[str, float, float]]  # by name: law, cost and error
    floors: Sequence[float] = ()  # errors that no cost avoids


def fronts(panels: Sequence[FrontPanel], labels: Mapping[str, str], cost: str) -> Figure:
    """Draw the panels side by side.

    Parameters
    ----------
    panels : sequence of FrontPanel
    labels : mapping of law to label
    cost : str
        Label of the axis.
    """
    figure, grid = sheet(5.2, 1, max(len(panels), 1), width_in=0.65 * WIDTH_in * max(len(panels), 2))
    looks = styles(list(labels))
    for axes, panel in zip(grid.flat, panels, strict=False):
        _panel(axes, panel, looks)
        axes.set_xlabel(cost)
    legend_below(figure, [], 5, law_keys(grid[0, 0], labels, _size), handlelength=3.2)
    return figure


def _panel(axes: Axes, panel: FrontPanel, looks: Mapping[str, LawStyle]) -> None:
    for floor in panel.floors:
        axes.axhline(floor, color=FAINT, linewidth=1.0, zorder=1)
    for law, values in panel.by_law.items():
        style = looks[law]
        axes.plot(*values[np.argsort(values[:, 0])].T, style.marker, markersize=_size(style), linewidth=1.3,
                  markeredgewidth=0.4, markeredgecolor="white", zorder=3, **style.line())  # fmt: skip
    axes.set(xscale="log", yscale="log")
    _set_limits(axes, panel)
    for name, (law, x, y) in panel.marked.items():
        if x <= axes.get_xlim()[1] and y <= axes.get_ylim()[1]:
            style = looks[law]
            axes.plot(x, y, style.marker, color=style.colour, markersize=1.5 * _size(style),
                      markerfacecolor="white", zorder=5)  # fmt: skip
            axes.annotate(name, (x, y), (-9, -1), textcoords="offset points", ha="right", va="center",
                          fontsize="small", zorder=5)  # fmt: skip
    name_axes(axes, y=panel.error, title=panel.title)
    faint_grid(axes, 0.25)


def _set_limits(axes: Axes, panel: FrontPanel) -> None:
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
        plain_ticks(axis, steps)


def _size(style: LawStyle) -> float:
    return SIZES.get(style.marker, 6.0)


# Larger multiples of the best are cut: bad trials would leave no room for the good ones.
DECADES_ON = 30.0


class Trials(NamedTuple):
    """Trials of one law."""

    law: str
    numbers: Array  # (n,)
    values: Array  # (n, objectives); of a pruned trial a lower bound, NaN of one that was lost
    completed: NDArray[np.bool_]  # (n,)
    best: NDArray[np.bool_]  # (n,)
    signs: Array  # (objectives,) −1 where large is good
    has_start: bool  # True if trial 0 is the reference of the others
    fresh: Array  # (b, objectives) of the best under fresh seeds; empty if there are none


def progress(by_label: Mapping[str, Trials], objectives: Sequence[str], title: str) -> Figure:
    """Each objective over the trials: a dot a completed one, a ring a pruned one, a line the best so far.

    Trials that were lost, or are off the scale, are ticks at the edge.

    Parameters
    ----------
    by_label : mapping of label to Trials
    objectives : sequence of str
    title : str
    """
    figure, grid = sheet(1.4 + 2.4 * len(objectives), len(objectives), title=title, sharex=True)
    panels = grid[:, 0]
    for place, (panel, name) in enumerate(zip(panels, objectives, strict=True)):
        for label, trials in by_label.items():
            _progress(panel, label, trials, place)
        _finish(panel, [trials.values[trials.completed, place] for trials in by_label.values()], "y")
        panel.set_ylabel(name, fontsize="small")
    panels[-1].set_xlabel("trial")
    legend_below(figure, panels)
    return figure


def front(by_label: Mapping[str, Trials], objectives: Sequence[str], title: str) -> Figure:
    """Draw two objectives of all completed trials, and their Pareto front.

    Parameters
    ----------
    by_label : mapping of label to Trials
    objectives : sequence of str
        Two.
    title : str
    """
    figure, ((panel,),) = sheet(5.6, title=title)
    for label, trials in by_label.items():
        colour, chosen = law_colour(trials.law), trials.values[trials.best]
        panel.plot(*trials.values[trials.completed].T, "o", color=colour, markersize=3, alpha=0.35,
                   label=f"{label}, trial")  # fmt: skip
        chosen = chosen[np.argsort(chosen[:, 0])]
        panel.step(*chosen.T, where="post" if trials.signs[0] > 0 else "pre", color=colour, linewidth=1.2)
        panel.plot(*chosen.T, "o", color=colour, markersize=5.5, label=f"{label}, front")
        if len(trials.fresh):
            panel.plot(*trials.fresh.T, "o", color=colour, markerfacecolor="white", markersize=5,
                       label=f"{label}, front under fresh seeds")  # fmt: skip
        if trials.has_start and trials.completed[0]:
            panel.plot(*trials.values[0], "*", color=INK, markersize=13, label=f"{label}, start", zorder=5)
    for which, place in (("x", 0), ("y", 1)):
        _finish(panel, [trials.values[trials.completed, place] for trials in by_label.values()], which)
    panel.set(xlabel=objectives[0], ylabel=objectives[1])
    legend_below(figure, [panel])
    return figure


def _progress(panel: Axes, label: str, trials: Trials, place: int) -> None:
    colour, values = law_colour(trials.law), trials.values[:, place]
    pruned = ~trials.completed & np.isfinite(values)
    lost = ~np.isfinite(values)
    panel.plot(trials.numbers[trials.completed], values[trials.completed], "o", color=colour, markersize=3.5,
               label=f"{label}, completed")  # fmt: skip
    panel.plot(trials.numbers[pruned], values[pruned], "o", color=colour, markerfacecolor="none",
               markersize=3.5, alpha=0.6, label=f"{label}, pruned: at least")  # fmt: skip
    if np.any(lost):
        edge = panel.get_xaxis_transform()
        panel.plot(trials.numbers[lost], np.ones(np.sum(lost)), "x", color=colour, transform=edge,
                   clip_on=False, markersize=5, label=f"{label}, lost")  # fmt: skip
    if np.any(trials.completed):
        sign = trials.signs[place]
        best = sign * np.minimum.accumulate(np.where(trials.completed, sign * values, np.inf))
        shown = np.isfinite(best)
        panel.step(trials.numbers[shown], best[shown], where="post", color=colour, linewidth=1.2,
                   label=f"{label}, best so far")  # fmt: skip


def _finish(panel: Axes, values: Sequence[Array], which: str) -> None:
    """Make an axis logarithmic if all values are positive, and cut values far from the best."""
    of_all = np.concatenate(values)
    if len(of_all) and np.all(of_all > 0):
        (panel.set_xscale if which == "x" else panel.set_yscale)("log")
        low, high = float(of_all.min()), float(of_all.max())
        limits = (low / 1.15, min(high, DECADES_ON * low) * 1.15)
        (panel.set_xlim if which == "x" else panel.set_ylim)(*limits)
    faint_grid(panel, 0.3, which="both")
