"""Figure of the shaft tip's path, desired and actual: a column a law, in space above and as a plan below."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D
from numpy.typing import NDArray

from spheretwin.viz.figures.style import (
    INK,
    WIDTH_in,
    faint_grid,
    styles,
)

Array = NDArray[np.float64]


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
    plan: Axes | None = None
    for place, (label, path) in enumerate(by_label.items()):
        colour = looks[path.law].colour
        space = figure.add_subplot(cells[0, place], projection="3d")
        _space(space, path, colour, (reach, aside), heights)
        space.set_title(f"({chr(ord('a') + place)}) {label}", fontsize="medium")
        plan = figure.add_subplot(cells[1, place], sharex=plan, sharey=plan)
        _plan(plan, path, colour, (reach, aside))
        if place == 0:
            plan.set_ylabel("y, mm")
    key = [
        plan.plot([], [], color=INK, linewidth=2, label="actual, in the colour of its law")[0],
        plan.plot([], [], color=INK, linewidth=0.9, linestyle=(0, (4, 2)), label="desired")[0],
        plan.plot([], [], "o", color=INK, markersize=5, label="start")[0],
    ] if plan else []  # fmt: skip
    if plan and not all(path.whole for path in by_label.values()):
        key += plan.plot([], [], "x", color=INK, markersize=9, markeredgewidth=2, label="ended early")
    figure.legend(handles=key, loc="outside lower center", ncols=4, frameon=False)
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
        axes.plot(*path.tip_mm[-1:, which].T, "x", color=colour, markersize=9, markeredgewidth=2)
