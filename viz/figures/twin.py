"""Figures of the twin of a machine: errors of its shadow, its residuals, and the evidence of its watch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from spheretwin.models.base.arrays import Array
from spheretwin.viz.figures.style import BROKEN, FAINT, INK, SERIES, legend_below, plain, sheet

COLOURS = (SERIES[1], SERIES[0])
"""Of a machine before and after its identification."""

MOST_SAMPLES = 400


class ErrorTrace(NamedTuple):
    """Error of an estimate."""

    t_s: Array
    error: Array  # (n, hinges)
    half_width: Array  # (n, hinges), of the band


class Sums(NamedTuple):
    """Logarithms of the evidence of changes over the windows of a log."""

    t_s: Array
    by_name: Mapping[str, Array]
    named: str | None
    """Sum of the change that took place."""
    change_s: float | None
    alarms_s: Sequence[float]


def errors(columns: Mapping[str, Mapping[str, ErrorTrace]], hinges: Sequence[str], title: str) -> Figure:
    """Draw errors of estimates with their bands: a column a quantity, a row a hinge, a colour a model.

    Parameters
    ----------
    columns : mapping of quantity to mapping of label to ErrorTrace
        At most two labels.
    hinges : sequence of str
    title : str
    """
    figure, grid = sheet(6.0, len(hinges), len(columns), title, sharex=True, sharey="col")
    for column, (quantity, by_label) in zip(grid.T, columns.items(), strict=True):
        for hinge, (panel, name) in enumerate(zip(column, hinges, strict=True)):
            for (label, trace), colour in zip(by_label.items(), COLOURS, strict=False):
                chosen = slice(None, None, -(-len(trace.t_s) // MOST_SAMPLES))
                t_s, half = trace.t_s[chosen], trace.half_width[chosen, hinge]
                panel.fill_between(
                    t_s, -half, half, color=colour, alpha=0.2, linewidth=0, label=f"95 % band {label}"
                )
                panel.plot(
                    t_s, trace.error[chosen, hinge], color=colour, linewidth=0.9, label=f"error {label}"
                )
            plain(panel, f"{name}: {quantity}")
        column[-1].set_xlabel("time, s", fontsize="small")
    legend_below(figure, [grid[0, 0]], 2)
    return figure


def residuals(panels: Mapping[str, Mapping[str, tuple[Array, Array]]], x: str, y: str, title: str) -> Figure:
    """Draw mean residuals by a quantity: a panel a hinge, a colour a model.

    Parameters
    ----------
    panels : mapping of hinge to mapping of label to middles of bins and means
        At most two labels.
    x, y, title : str
    """
    figure, (row,) = sheet(3.2, 1, len(panels), title, sharey=True)
    for panel, (name, by_label) in zip(row, panels.items(), strict=True):
        for (label, (middle, mean)), colour, marker in zip(by_label.items(), COLOURS, "os", strict=False):
            panel.plot(middle, mean, color=colour, marker=marker, markersize=4, label=label)
        panel.axhline(0.0, color=INK, linewidth=0.8)
        plain(panel, x=f"{name}: {x}")
    row[0].set_ylabel(y, fontsize="small")
    legend_below(figure, row, 2)
    return figure


def sums(panels: Mapping[str, Sums], threshold: float, title: str) -> Figure:
    """Draw the evidence of changes over time: a panel a log, one line each change that is watched for.

    Parameters
    ----------
    panels : mapping of title to Sums
    threshold : float
        Of an alarm.
    title : str
    """
    figure, grid = sheet(1.0 + 1.35 * len(panels), len(panels), title=title, sharex=True, sharey=True)
    column = grid[:, 0]
    for panel, (name, watched) in zip(column, panels.items(), strict=True):
        for what, values in watched.by_name.items():
            if what != watched.named:
                panel.plot(watched.t_s, values, color=FAINT, linewidth=0.6, label="other changes")
        if watched.named:
            named = {"color": SERIES[0], "linewidth": 1.8, "label": "change that took place"}
            panel.plot(watched.t_s, watched.by_name[watched.named], **named)
        panel.axhline(threshold, color=BROKEN, linestyle="--", linewidth=1.0, label="threshold")
        if watched.change_s is not None:
            panel.axvline(
                watched.change_s, color=INK, linestyle=":", linewidth=1.2, label="the machine changes"
            )
        alarm = {"color": BROKEN, "markersize": 7, "linestyle": "", "label": "alarm", "zorder": 4}
        panel.plot(watched.alarms_s, [threshold] * len(watched.alarms_s), "v", **alarm)
        plain(panel, "log evidence")
        panel.set_title(name, fontsize="small", loc="left")
    # Linear up to the threshold: a large change exceeds it hundreds of times within a window.
    column[0].set_yscale("symlog", linthresh=threshold, linscale=1.5)
    column[0].set_ylim(bottom=0.0)
    column[0].set_yticks([0, 10, 100, 1000], ["0", "10", "100", "1000"])
    column[0].yaxis.set_minor_locator(NullLocator())
    column[-1].set_xlabel("time, s", fontsize="small")
    legend_below(figure, column, 3)
    return figure
