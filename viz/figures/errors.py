"""Figures of tracking errors: their course under several laws, and their size under several conditions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from spheretwin.viz.figures.plots import FAINT, INK, WIDTH_in
from spheretwin.viz.palette import law_colour

Array = NDArray[np.float64]

LEAST_deg = 1e-3  # less is drawn as this much, on a logarithmic axis
LINE_in = 0.235


class Course(NamedTuple):
    """Errors of one law over time."""

    law: str
    errors_deg: Array  # (seeds, windows, axes)
    paper_deg: float
    paper_axes: tuple[int, ...]  # for which the paper prints it; none where it has not the law


class Line(NamedTuple):
    """Largest errors under one condition, one for each seed."""

    label: str
    measured_deg: Array
    true_deg: Array


class Group(NamedTuple):
    """Conditions of one law."""

    law: str
    label: str
    lines: Sequence[Line]
    paper_deg: float | None


def courses(by_label: Mapping[str, Course], window_s: float, axes_names: Sequence[str], title: str) -> Figure:
    """Errors over time: a panel an axis, a colour a law, the median a line and the range a band.

    Parameters
    ----------
    by_label : mapping of label to Course
    window_s : float, s
        Length of what each entry is the largest error of.
    axes_names : sequence of str
    title : str
    """
    figure = Figure(figsize=(WIDTH_in, 6.6), layout="constrained")
    panels = figure.subplots(len(axes_names), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axis, (panel, name) in enumerate(zip(panels, axes_names, strict=True)):
        for label, course in by_label.items():
            _course(panel, label, course, window_s, axis)
        _on_logarithmic(panel, "y")
        panel.set_ylabel(f"|error| of {name}, degrees")
    panels[0].set_title(title, fontsize="medium")
    panels[-1].set_xlabel("time, s")
    panels[0].legend(loc="lower center", bbox_to_anchor=(0.5, 1.1), ncols=len(by_label), frameon=False)
    return figure


def lines(groups: Sequence[Group], quantity: str, title: str) -> Figure:
    """Largest errors by law and condition: a row a condition, a dot the median, a line the range.

    Parameters
    ----------
    groups : sequence of Group
    quantity : str
        What the axis is, with its unit.
    title : str
    """
    rows = [len(group.lines) for group in groups]
    figure = Figure(figsize=(WIDTH_in, 1.2 + LINE_in * (sum(rows) + 2 * len(rows))), layout="constrained")
    panels = figure.subplots(len(groups), 1, sharex=True, squeeze=False, height_ratios=rows)[:, 0]
    for panel, group in zip(panels, groups, strict=True):
        colour = law_colour(group.law)
        for row, line in enumerate(group.lines):
            _spread(panel, row - 0.13, line.measured_deg, colour, colour)
            _spread(panel, row + 0.13, line.true_deg, colour, "white")
        if group.paper_deg:
            panel.axvline(group.paper_deg, color=INK, linestyle=":", linewidth=1.4, zorder=1)
        panel.set_yticks(range(len(group.lines)), [line.label for line in group.lines])
        panel.set_ylim(len(group.lines) - 0.5, -0.5)
        _on_logarithmic(panel, "x")
        panel.set_title(group.label, fontsize="small", loc="left", color=colour, fontweight="bold")
    panels[-1].set_xlabel(quantity)
    for inside, label in ((INK, "measured"), ("white", "true")):
        panels[-1].plot([], [], "o", color=INK, markerfacecolor=inside, markersize=5, label=label)
    panels[-1].plot([], [], ":", color=INK, linewidth=1.4, label="the paper's figure")
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    figure.suptitle(title, fontsize="medium")
    return figure


def _course(panel: Axes, label: str, course: Course, window_s: float, axis: int) -> None:
    errors, colour = np.maximum(course.errors_deg[:, :, axis], LEAST_deg), law_colour(course.law)
    whole = ~np.any(np.isnan(errors), axis=0)  # where every seed still runs
    t_s = window_s * (np.arange(errors.shape[1])[whole] + 0.5)
    low, middle, high = np.quantile(errors[:, whole], [0, 0.5, 1], axis=0)
    panel.fill_between(t_s, low, high, color=colour, alpha=0.18, linewidth=0)
    panel.plot(t_s, middle, color=colour, linewidth=1.3, label=label)
    if axis in course.paper_axes:
        panel.axhline(course.paper_deg, color=colour, linestyle=":", linewidth=1.4, zorder=1)


def _spread(panel: Axes, y: float, values: Array, colour: str, inside: str) -> None:
    low, middle, high = np.maximum(np.quantile(values, [0, 0.5, 1]), LEAST_deg)
    panel.plot([low, high], [y, y], color=colour, linewidth=1.6, alpha=0.6, solid_capstyle="butt")
    panel.plot(middle, y, "o", color=colour, markerfacecolor=inside, markersize=5)


def _on_logarithmic(panel: Axes, which: Literal["x", "y"]) -> None:
    """A logarithmic axis in plain numbers, a faint grid behind, no box."""
    axis = panel.yaxis if which == "y" else panel.xaxis
    (panel.set_yscale if which == "y" else panel.set_xscale)("log")
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())
    panel.grid(visible=True, which="both", axis=which, color=FAINT, alpha=0.3, linewidth=0.6)
    panel.set_axisbelow(True)
    panel.spines[["top", "right"]].set_visible(False)
