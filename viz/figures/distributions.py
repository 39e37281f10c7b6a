"""Figures of a study over many axes: distributions of figures, and their rank correlations with the axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from spheretwin.models.base.arrays import Array
from spheretwin.viz.figures.maps import fit_scale
from spheretwin.viz.figures.style import FAINT, INK, WIDTH_in, legend_below, plain, sheet
from spheretwin.viz.theme import law_colours

ACROSS = 3
MOST_DOTS = 2000  # of a law in a panel: more only blacken it
BINS = 10


class Rank(NamedTuple):
    """Rank correlations of a figure with the axes, under one law."""

    by_value: Array  # (axes,) rank correlation with the value
    by_distance: Array  # (axes,) and with its distance from the middle one
    chance: float  # below this, 95 % of what does not matter
    is_partial: bool  # True if the effect of the other axes is removed


def distributions(
    figures: Mapping[str, Mapping[str, Array]], totals: Mapping[str, float], title: str
) -> Figure:
    """Share of the rows at or below each value: a panel a figure, a colour a law.

    Rows without a figure, as a run that was lost or never settled, are missing from the share.

    Parameters
    ----------
    figures : mapping of figure to mapping of law to (n,) array
        Finite numbers only.
    totals : mapping of law to float
        All rows, those without a figure included; their share if the numbers are every n-th of many.
    title : str
    """
    down, colours = -(-len(figures) // ACROSS), law_colours(list(totals))
    figure, grid = sheet(1.0 + 2.1 * down, down, ACROSS, title, 1.15 * WIDTH_in, len(figures), sharey=True)
    for axes, (name, by_law) in zip(grid.flat, figures.items(), strict=False):
        for law, values in by_law.items():
            numbers = np.sort(values)
            share = np.arange(1, len(numbers) + 1) / totals[law]
            axes.step(numbers, share, where="post", color=colours[law], linewidth=1.3)
        fit_scale(axes, "x", np.concatenate(list(by_law.values())))
        axes.set_ylim(0, 1.02)
        plain(axes, x=name, alpha=0.3)
    for axes in grid[:, 0]:
        axes.set_ylabel("share of rows", fontsize="small")
    for law in totals:
        grid.flat[0].plot([], [], color=colours[law], label=law)
    legend_below(figure, [grid[0, 0]], 5)
    return figure


def ranks(names: Sequence[str], by_law: Mapping[str, Rank], title: str) -> Figure:
    """Rank correlations, a row an axis: bars with the value, rings with its distance from the middle one.

    Parameters
    ----------
    names : sequence of str
        Axes, the strongest first.
    by_law : mapping of law to Rank
        In the same order.
    title : str
    """
    figure, ((axes,),) = sheet(1.4 + len(names) * (0.14 + 0.13 * len(by_law)), title=title)
    thick, colours = 0.76 / len(by_law), law_colours(list(by_law))
    for place, (law, rank) in enumerate(by_law.items()):
        y = np.arange(len(names)) + (place - (len(by_law) - 1) / 2) * thick
        axes.barh(y, rank.by_value, height=0.85 * thick, color=colours[law], alpha=0.75, label=law)
        axes.plot(rank.by_distance, y, "o", color=INK, markerfacecolor="white", markersize=4.5)
    chance = max(rank.chance for rank in by_law.values())
    axes.axvspan(-chance, chance, color=FAINT, alpha=0.25, linewidth=0, zorder=0, label="by chance, 95 %")
    axes.plot([], [], "o", color=INK, markerfacecolor="white", markersize=4.5,
              label="with the distance from its middle")  # fmt: skip
    axes.axvline(0, color=INK, linewidth=0.8)
    axes.set_yticks(range(len(names)), list(names))
    axes.set_ylim(len(names) - 0.5, -0.5)
    partial = all(rank.is_partial for rank in by_law.values())
    plain(axes, x="partial rank correlation" if partial else "rank correlation", alpha=0.3)
    legend_below(figure, [axes], fontsize="small")
    return figure


def scatters(
    axes_values: Mapping[str, Mapping[str, Array]],
    figure_values: Mapping[str, Array],
    quantity: str,
    title: str,
) -> Figure:
    """A figure against the value of each of some axes: dots the rows, a line their median.

    Parameters
    ----------
    axes_values : mapping of axis to mapping of law to (n,) array
    figure_values : mapping of law to (n,) array
    quantity, title : str
    """
    across, colours = min(4, len(axes_values)), law_colours(list(figure_values))
    down = -(-len(axes_values) // across)
    width_in = max(2.6 * across, WIDTH_in / 2)
    figure, grid = sheet(1.1 + 2.2 * down, down, across, title, width_in, len(axes_values), sharey=True)
    for axes, (name, by_law) in zip(grid.flat, axes_values.items(), strict=False):
        for law, x in by_law.items():
            _scatter(axes, x, figure_values[law], colours[law], law)
        fit_scale(axes, "y", np.concatenate(list(figure_values.values())))
        axes.xaxis.set_major_locator(MaxNLocator(4))
        plain(axes, x=name, alpha=0.3)
    for axes in grid[:, 0]:
        axes.set_ylabel(quantity, fontsize="small")
    legend_below(figure, [grid[0, 0]], fontsize="small")
    return figure


def _scatter(axes: Axes, x: Array, y: Array, colour: str, law: str) -> None:
    step = -(-len(x) // MOST_DOTS) if len(x) else 1
    axes.plot(x[::step], y[::step], ".", color=colour, markersize=4, alpha=0.35, markeredgewidth=0)
    edges = np.unique(np.quantile(x, np.linspace(0, 1, BINS + 1)))
    if len(edges) > 2:
        inside = [(x >= low) & (x <= high) for low, high in pairwise(edges)]
        middles = [(np.median(x[rows]), np.median(y[rows])) for rows in inside]
        axes.plot(*zip(*middles, strict=True), color=colour, linewidth=2, label=f"{law}, median")
