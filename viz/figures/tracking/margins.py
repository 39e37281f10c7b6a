"""Figure of margins: an error against what is made worse, a panel a thing, a line a law."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spheretwin.viz.figures.plots import FAINT, INK, WIDTH_in
from spheretwin.viz.figures.tracking.style import styles

Array = NDArray[np.float64]

WIDE = 9.0
"""Ratio of largest to smallest step from which on a scale is logarithmic."""


class Panel(NamedTuple):
    """One thing that is made worse."""

    name: str
    by_law: Mapping[str, Array]  # (n, 3) step, error in rad, whether the law holds


def margins(
    panels: Sequence[Panel], labels: Mapping[str, str], bound_rad: float, quantity: str, title: str
) -> Figure:
    """Draw them on one scale of errors.

    Parameters
    ----------
    panels : sequence of Panel
    labels : mapping of law to label
    bound_rad : float, rad
        Below which a law holds.
    quantity, title : str
    """
    across = min(3, len(panels))
    down = -(-len(panels) // across)
    figure = Figure(figsize=(1.2 * WIDTH_in, 1.2 + 2.7 * down), layout="constrained")
    grid = figure.subplots(down, across, sharey=True, squeeze=False)
    looks = styles(list(labels))
    for spare in grid.flat[len(panels) :]:
        spare.set_visible(False)
    for axes, panel in zip(grid.flat, panels, strict=False):
        for law, values in panel.by_law.items():
            step, error_mrad, held = values[:, 0], 1e3 * values[:, 1], values[:, 2] > 0
            style = looks[law]
            axes.plot(step, error_mrad, linewidth=1.4, **style.line())
            for chosen, inside in ((held, style.colour), (~held, "white")):
                axes.plot(step[chosen], error_mrad[chosen], style.marker, color=style.colour,
                          markerfacecolor=inside, markersize=6)  # fmt: skip
        axes.axhline(1e3 * bound_rad, color=INK, linestyle="--", linewidth=1)
        axes.set_yscale("log")
        steps = np.concatenate([values[:, 0] for values in panel.by_law.values()])
        if steps.min() > 0 and steps.max() > WIDE * steps.min():
            axes.set_xscale("log")
            axes.xaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_major_formatter("{x:g}")
        axes.set_xlabel(panel.name)
        axes.grid(visible=True, color=FAINT, alpha=0.35, linewidth=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    figure.supylabel(quantity, fontsize="medium")
    handles = [
        grid.flat[0].plot([], [], style.marker, markersize=6, label=labels[law], **style.line())[0]
        for law, style in looks.items()
    ]
    handles += grid.flat[0].plot([], [], "o", color=INK, markerfacecolor="white", label="does not hold")
    figure.legend(handles=handles, loc="outside lower center", ncols=5, frameon=False, handlelength=3.2)
    figure.suptitle(title, fontsize="medium")
    return figure
