"""Figures of a study of faults: shares by number, latencies, a triangle of pairs, errors against torque."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from spheretwin.models.base.arrays import Array
from spheretwin.viz.figures.style import INK, SERIES, WIDTH_in, faint_grid, name_axes, sheet

MARKERS = ("o", "s", "^", "D", "v")
COLOURS = "cividis"  # distinct for the colour-blind, and in grey
EVERY = 3  # every third group number is written


def shares(by_name: Mapping[str, Mapping[int, float]], x: str, y: str, title: str) -> Figure:
    """Lines of shares in percent over a number.

    Parameters
    ----------
    by_name : mapping of name to mapping of number to share, 0 to 1
    x, y, title : str
    """
    figure, ((axes,),) = sheet(4.2, title=title)
    for (name, by_number), colour, marker in zip(by_name.items(), SERIES, MARKERS, strict=False):
        percent = [100 * share for share in by_number.values()]
        axes.plot(
            list(by_number), percent, marker=marker, color=colour, linewidth=1.4, markersize=5, label=name
        )
    numbers = sorted({number for by_number in by_name.values() for number in by_number})
    axes.set_xticks(numbers)
    axes.set_ylim(-3, 103)
    faint_grid(axes, 0.4, axis="y")
    axes.set(xlabel=x, ylabel=y)
    axes.legend(frameon=False)
    return figure


def remaining(by_name: Mapping[str, Sequence[float]], x: str, y: str, title: str) -> Figure:
    """Draw the share in percent whose time has not come as steps, on logarithmic axes.

    Parameters
    ----------
    by_name : mapping of name to times
        Positive; infinite times never come.
    x, y, title : str
    """
    figure, ((axes,),) = sheet(4.2, title=title)
    finite = [time for times in by_name.values() for time in times if np.isfinite(time)]
    end = max(finite, default=1.0)
    for (name, times), colour in zip(by_name.items(), SERIES, strict=False):
        rising = np.sort([time for time in times if np.isfinite(time)])
        left = 100 * (1 - np.arange(len(rising) + 1) / len(times))
        percent = np.append(left[1:], left[-1])
        axes.step(np.append(rising, end), percent, where="post", color=colour, linewidth=1.4, label=name)
    axes.set(xscale="log", yscale="log")
    faint_grid(axes, 0.4)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set(xlabel=x, ylabel=y)
    axes.legend(frameon=False)
    return figure


def triangles(panels: Mapping[str, Array], label: str, quantity: str, bound: float, title: str) -> Figure:
    """Triangles side by side, a square a pair, on one logarithmic scale; a cross above the bound.

    Parameters
    ----------
    panels : mapping of title to (n, n) array
        NaN stays empty.
    label : str
        Label of both axes.
    quantity : str
        Quantity of the colours.
    bound : float
    title : str
    """
    values = np.concatenate([panel[np.isfinite(panel)] for panel in panels.values()])
    lowest, highest = min(float(values.min(initial=1.0)), 1.0), max(float(values.max(initial=0.0)), 2 * bound)
    scale = LogNorm(vmin=lowest, vmax=highest)
    figure, (sides,) = sheet(4.1, 1, len(panels), title, 1.4 * WIDTH_in, sharey=True)
    for axes, (name, panel) in zip(sides, panels.items(), strict=True):
        image = axes.imshow(panel, norm=scale, cmap=COLOURS)
        rows, columns = np.nonzero(panel > bound)
        # White on the dark half of the scale, black on the light one.
        ink = ["white" if scale(panel[at]) < 0.5 else "black" for at in zip(rows, columns, strict=True)]
        axes.scatter(columns, rows, marker="x", c=ink, s=14, linewidths=0.9)
        ticks = range(0, len(panel), EVERY)
        axes.set_xticks(ticks)
        axes.set_yticks(ticks)
        name_axes(axes, x=label, title=name)
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
    sides[0].set_ylabel(label)
    bar = figure.colorbar(image, ax=list(sides), shrink=0.85, aspect=28, label=quantity)
    ticks_at = [tick for tick in (1, 1.5, 2, 3, 4, 6, 8, 10, 20, 50, 100) if lowest <= tick <= highest]
    bar.set_ticks(ticks_at, labels=[f"{tick:g}" for tick in ticks_at])
    bar.ax.minorticks_off()
    return figure


def clouds(
    panels: Mapping[str, Sequence[tuple[float, float, int]]],
    labels: tuple[str, str, str],
    bounds: tuple[float, float],
    title: str,
) -> Figure:
    """Points side by side on logarithmic axes, coloured by a number, with a dashed line on each axis.

    Parameters
    ----------
    panels : mapping of title to points (x, y, number)
    labels : tuple of str
        Labels of x, y and the number.
    bounds : tuple of float
        Bounds of x and y.
    title : str
    """
    numbers = sorted({point[2] for points in panels.values() for point in points})
    scale = BoundaryNorm([*numbers, numbers[-1] + 1], 256)
    figure, (sides,) = sheet(4.6, 1, len(panels), title, 1.25 * WIDTH_in, sharex=True, sharey=True)
    for axes, (name, points) in zip(sides, panels.items(), strict=True):
        finite = [point for point in points if np.all(np.isfinite(point))]
        x, y, number = np.array(finite).reshape(-1, 3).T
        cloud = axes.scatter(x, y, c=number, norm=scale, cmap=COLOURS, s=7, linewidths=0, rasterized=True)
        _dashed(axes, bounds)
        axes.set(xscale="log", yscale="log")
        name_axes(axes, x=labels[0], title=name)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter(NullFormatter())
        axes.spines[["top", "right"]].set_visible(False)
    sides[0].set_ylabel(labels[1])
    middles = [
        number + 0.5 * (after - number)
        for number, after in zip(numbers, [*numbers[1:], numbers[-1] + 1], strict=True)
    ]
    bar = figure.colorbar(cloud, ax=list(sides), label=labels[2])
    bar.set_ticks(middles, labels=[str(number) for number in numbers])
    bar.ax.tick_params(length=0)
    bar.ax.minorticks_off()
    return figure


def _dashed(axes: Axes, bounds: tuple[float, float]) -> None:
    axes.axvline(bounds[0], color=INK, linestyle="--", linewidth=0.9, zorder=0)
    axes.axhline(bounds[1], color=INK, linestyle="--", linewidth=0.9, zorder=0)
