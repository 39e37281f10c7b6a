"""Figures of tracking under several laws: errors over time and by condition, paths of the shaft tip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import NullFormatter
from mpl_toolkits.mplot3d import Axes3D

from spheretwin.models.base.arrays import Array
from spheretwin.viz.figures.style import (
    INK,
    LawStyle,
    WIDTH_in,
    faint_grid,
    legend_below,
    name_rows,
    on_errors,
    sheet,
    styles,
)
from spheretwin.viz.theme import law_colour, text_colour

LEAST_deg = 1e-3  # less is drawn as this much, on a logarithmic axis
LINE_in = 0.235


class ErrorLine(NamedTuple):
    """Largest errors under one condition, one for each seed."""

    label: str
    measured_deg: Array
    true_deg: Array


class ErrorGroup(NamedTuple):
    """Conditions of one law."""

    law: str
    label: str
    lines: Sequence[ErrorLine]
    paper_deg: float | None


def lines(groups: Sequence[ErrorGroup], quantity: str, title: str) -> Figure:
    """Largest errors by law and condition: a row a condition, a dot the median, a line the range.

    Parameters
    ----------
    groups : sequence of ErrorGroup
    quantity : str
        Label of the axis, with its unit.
    title : str
    """
    rows = [len(group.lines) for group in groups]
    height_in = 1.2 + LINE_in * (sum(rows) + 2 * len(rows))
    figure, grid = sheet(height_in, len(groups), title=title, sharex=True, height_ratios=rows)
    panels = grid[:, 0]
    for panel, group in zip(panels, groups, strict=True):
        colour = law_colour(group.law)
        for row, line in enumerate(group.lines):
            _spread(panel, row - 0.13, line.measured_deg, colour, colour)
            _spread(panel, row + 0.13, line.true_deg, colour, "white")
        if group.paper_deg:
            panel.axvline(group.paper_deg, color=INK, linestyle=":", linewidth=1.4, zorder=1)
        name_rows(panel, [line.label for line in group.lines])
        panel.xaxis.set_major_formatter("{x:g}")
        panel.xaxis.set_minor_formatter(NullFormatter())
        panel.set_title(
            group.label, fontsize="small", loc="left", color=text_colour(colour), fontweight="bold"
        )
    panels[-1].set_xlabel(quantity)
    for inside, label in ((INK, "measured"), ("white", "true")):
        panels[-1].plot([], [], "o", color=INK, markerfacecolor=inside, markersize=5, label=label)
    panels[-1].plot([], [], ":", color=INK, linewidth=1.4, label="the paper's figure")
    legend_below(figure, panels, 3)
    return figure


def _band(
    panel: Axes, label: str, values: Array, style: LawStyle, window_s: float, shift: float
) -> tuple[Array, Array]:
    """Draw the median over the seeds as a line and their range as a band while every seed runs.

    Parameters
    ----------
    panel : Axes
    label : str
    values : (seeds, windows) array
    style : LawStyle
    window_s : float, s
    shift : float
        Shift of the markers along the line, as a share of their distance.

    Returns
    -------
    t_s, median : (n,) arrays
    """
    running = ~np.any(np.isnan(values), axis=0)
    low, middle, high = np.quantile(values[:, running], [0, 0.5, 1], axis=0)
    t_s: Array = window_s * (np.flatnonzero(running).astype(np.float64) + 0.5)
    every = max(1, values.shape[1] // MARKS)
    panel.fill_between(t_s, low, high, color=style.colour, alpha=0.2, linewidth=0)
    panel.plot(t_s, middle, linewidth=1.3, marker=style.marker, markersize=4.5, label=label,
               markevery=(int(shift * every), every), **style.line())  # fmt: skip
    return t_s, middle


def _spread(panel: Axes, y: float, values: Array, colour: str, inside: str) -> None:
    low, middle, high = np.maximum(np.quantile(values, [0, 0.5, 1]), LEAST_deg)
    panel.plot([low, high], [y, y], color=colour, linewidth=1.6, alpha=0.6, solid_capstyle="butt")
    panel.plot(middle, y, "o", color=colour, markerfacecolor=inside, markersize=5)


LEAST_mrad = 0.2  # less is drawn as this much, on a logarithmic axis
MARKS = 9  # markers along a line
ENDED: dict[str, Any] = {"marker": "x", "color": INK, "markersize": 9, "markeredgewidth": 2, "linestyle": ""}
OUTLINED = [withStroke(linewidth=1.6, foreground="white")]  # visible on a dark line too


class ErrorBand(NamedTuple):
    """Errors of one law."""

    law: str
    error_rad: Array  # (seeds, windows, hinges) largest within each; no numbers after the end of a run
    paper_rad: float = 0.0  # printed in the paper, for some hinges
    paper_hinges: tuple[int, ...] = ()


class AngleTraces(NamedTuple):
    """Angles of one run."""

    law: str
    t_s: Array  # (n,)
    q_rad: Array  # (n, hinges)
    desired_t_s: Array  # (m,)
    desired_rad: Array  # (m, hinges) of the whole motion, for any length of the run
    whole: bool  # True if it was completed


def errors(by_label: Mapping[str, ErrorBand], window_s: float, hinges: Sequence[str], title: str) -> Figure:
    """Errors over time: the median over the seeds a line, their range a band, a cross where runs end early.

    A dotted line is a printed error.

    Parameters
    ----------
    by_label : mapping of label to ErrorBand
    window_s : float, s
        Length of what each entry is the largest error of.
    hinges : sequence of str
    title : str
    """
    figure, grid = sheet(7.4, len(hinges), title=title, sharex=True)
    panels = grid[:, 0]
    looks = styles([course.law for course in by_label.values()])
    highest = max(float(np.nanmax(1e3 * course.error_rad)) for course in by_label.values())
    longest = max(course.error_rad.shape[1] for course in by_label.values())
    for hinge, (panel, name) in enumerate(zip(panels, hinges, strict=True)):
        for place, (label, course) in enumerate(by_label.items()):
            values, style = np.maximum(1e3 * course.error_rad[:, :, hinge], LEAST_mrad), looks[course.law]
            t_s, middle = _band(panel, label, values, style, window_s, place / len(by_label))
            if len(t_s) < longest and len(t_s):
                panel.plot(t_s[-1], middle[-1], **{**ENDED, "color": style.colour})
            if hinge in course.paper_hinges:
                panel.axhline(1e3 * course.paper_rad, color=style.colour, linestyle=":", linewidth=1.4)
        on_errors([panel], LEAST_mrad, 1.3 * highest)
        panel.set_ylabel(f"|error| of {name}, mrad")
    panels[-1].set_xlabel("time, s")
    if any(_ends_early(course, longest) for course in by_label.values()):
        panels[0].plot([], [], label="ended early", **ENDED)
    legend_below(figure, panels[:1], 5 if max(map(len, by_label)) < 20 else 2, handlelength=3.2)
    return figure


def _ends_early(course: ErrorBand, longest: int) -> bool:
    return course.error_rad.shape[1] < longest or bool(np.isnan(course.error_rad).any())


def angles(by_label: Mapping[str, AngleTraces], hinges: Sequence[str], title: str) -> Figure:
    """Draw angles and their references: a column for each law, a row for each hinge.

    Parameters
    ----------
    by_label : mapping of label to AngleTraces
    hinges : sequence of str
    title : str
    """
    width_in = max(2.5 * len(by_label), WIDTH_in)
    figure, grid = sheet(5.6, len(hinges), len(by_label), title, width_in, sharex=True, sharey="row")
    looks = styles([motion.law for motion in by_label.values()])
    for column, (place, (label, motion)) in zip(grid.T, enumerate(by_label.items()), strict=True):
        colour = looks[motion.law].colour
        for hinge, panel in enumerate(column):
            panel.plot(motion.t_s, motion.q_rad[:, hinge], color=colour, linewidth=2.2)
            panel.plot(motion.desired_t_s, motion.desired_rad[:, hinge], color=INK, linewidth=1,
                       linestyle=(0, (4, 2)), path_effects=OUTLINED)  # fmt: skip
            if not motion.whole:
                panel.plot(motion.t_s[-1], motion.q_rad[-1, hinge], **{**ENDED, "color": colour})
            faint_grid(panel)
        column[0].set_title(f"({chr(ord('a') + place)}) {label}", fontsize="medium")
        column[-1].set_xlabel("time, s")
    for panel, name in zip(grid[:, 0], hinges, strict=True):
        panel.set_ylabel(f"{name}, rad")
    first = grid[0, 0]
    first.plot([], [], color=INK, linewidth=2.2, label="q, in the colour of its law")
    first.plot([], [], color=INK, linewidth=1, linestyle=(0, (4, 2)), label="q_d, desired")
    if not all(motion.whole for motion in by_label.values()):
        first.plot([], [], label="ended early", **ENDED)
    legend_below(figure, [first], 3)
    return figure


class TipPath(NamedTuple):
    """Path of the tip in one run."""

    law: str
    tip_mm: Array  # (n, 3)
    desired_mm: Array  # (n, 3)
    whole: bool  # True if it was completed


def paths(by_label: Mapping[str, TipPath], title: str) -> Figure:
    """Draw them, on the same scales; a cross where a run ended early.

    Parameters
    ----------
    by_label : mapping of label to TipPath
    title : str
    """
    count = len(by_label)
    figure = Figure(figsize=(max(2.9 * count, WIDTH_in), 4.7), layout="constrained")
    cells = figure.add_gridspec(2, count, height_ratios=[1.9, 1])
    looks = styles([path.law for path in by_label.values()])
    every = np.concatenate([tips for path in by_label.values() for tips in (path.tip_mm, path.desired_mm)])
    reach, aside = (1.25 * float(np.abs(every[:, place]).max()) for place in range(2))
    heights = (float(every[:, 2].min()), float(every[:, 2].max()))
    plans: list[Axes] = []
    for place, (label, path) in enumerate(by_label.items()):
        colour = looks[path.law].colour
        space = figure.add_subplot(cells[0, place], projection="3d")
        _space(space, path, colour, (reach, aside), heights)
        space.set_title(f"({chr(ord('a') + place)}) {label}", fontsize="medium")
        shared = plans[0] if plans else None
        plans.append(figure.add_subplot(cells[1, place], sharex=shared, sharey=shared))
        _plan(plans[-1], path, colour, (reach, aside))
    if plans:
        plans[0].set_ylabel("y, mm")
        plans[0].plot([], [], color=INK, linewidth=2, label="actual, in the colour of its law")
        plans[0].plot([], [], color=INK, linewidth=0.9, linestyle=(0, (4, 2)), label="desired")
        plans[0].plot([], [], "o", color=INK, markersize=5, label="start")
    if not all(path.whole for path in by_label.values()):
        plans[0].plot([], [], label="ended early", **ENDED)
    legend_below(figure, plans[:1])
    figure.suptitle(title, fontsize="medium")
    return figure


def _space(
    axes: Axes3D, path: TipPath, colour: str, sides: tuple[float, float], heights: tuple[float, float]
) -> None:
    reach, aside = sides
    axes.plot(*path.tip_mm.T, color=colour, linewidth=1.8)
    axes.plot(*path.desired_mm.T, color=INK, linewidth=0.9, linestyle=(0, (4, 2)))
    _ends(axes, path, colour, slice(None))
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-aside, aside)
    axes.set_zlim(*heights)
    axes.set_box_aspect((1, aside / reach, 0.5), zoom=1.3)
    axes.view_init(elev=28, azim=-58)
    axes.tick_params(labelsize="x-small", pad=-2)
    axes.locator_params(nbins=4)
    axes.set_xlabel("x, mm", fontsize="x-small", labelpad=-6)
    axes.set_ylabel("y, mm", fontsize="x-small", labelpad=-6)
    axes.set_zlabel("z, mm", fontsize="x-small", labelpad=-6)


def _plan(axes: Axes, path: TipPath, colour: str, sides: tuple[float, float]) -> None:
    reach, aside = sides
    axes.plot(*path.tip_mm[:, :2].T, color=colour, linewidth=2)
    axes.plot(*path.desired_mm[:, :2].T, color=INK, linewidth=0.9, linestyle=(0, (4, 2)))
    _ends(axes, path, colour, slice(0, 2))
    axes.set_aspect("equal")
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-aside, aside)
    axes.set_xlabel("x, mm")
    faint_grid(axes)


def _ends(axes: Axes, path: TipPath, colour: str, which: slice) -> None:
    """Mark the start of a path, and an early end."""
    axes.plot(*path.tip_mm[:1, which].T, "o", color=INK, markersize=5)
    if not path.whole:
        axes.plot(*path.tip_mm[-1:, which].T, **{**ENDED, "color": colour})
