"""Figure of fronts: an error against what it costs, a panel a condition, both logarithmic."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator
from numpy.typing import NDArray

from spheretwin.viz.figures.plots import FAINT, INK, WIDTH_in
from spheretwin.viz.figures.tracking.style import Style, styles

Array = NDArray[np.float64]

MARGIN = 1.15
FAINTLY = 0.3
SIZES = {"*": 9.0}
"""Of markers that look smaller than others."""


LEFT = 1.45
"""The same where there are names at the left of what is marked."""


class Cloud(NamedTuple):
    """Settings of one law."""

    values: Array  # (n, 2) cost and error
    front: NDArray[np.bool_]  # (n,)
    begins: NDArray[np.bool_]  # (n,) the one that is shipped


class Panel(NamedTuple):
    """One condition."""

    title: str
    error: str
    by_law: Mapping[str, Cloud]
    common: Array  # (n, 2) the front of all laws, by ascending cost
    marked: Mapping[str, tuple[str, float, float]]  # by name: law, cost and error
    most: float  # times the least error, beyond which nothing is drawn
    beside: Mapping[str, Array] = {}  # (n, 2) fronts of another condition, by law


def fronts(panels: Sequence[Panel], labels: Mapping[str, str], cost: str, across: int) -> Figure:
    """Draw them.

    Parameters
    ----------
    panels : sequence of Panel
    labels : mapping of law to label
    cost : str
    across : int
        Panels in a row.
    """
    down = -(-len(panels) // across)
    figure = Figure(figsize=(1.3 * WIDTH_in, 1.2 + 4.0 * down), layout="constrained")
    grid = figure.subplots(down, across, squeeze=False)
    looks = styles(list(labels))
    for axes, panel in zip(grid.flat, panels, strict=False):
        _panel(axes, panel, looks)
        axes.set_xlabel(cost)
    handles = [
        grid.flat[0].plot([], [], style.marker, markersize=_size(style), label=labels[law], **style.line())[0]
        for law, style in looks.items()
    ]
    handles += grid.flat[0].plot([], [], "o", color=INK, markersize=11, markerfacecolor="none",
                                 label="as it begins")  # fmt: skip
    handles += grid.flat[0].plot([], [], color=FAINT, alpha=0.55, linewidth=8, label="common front")
    figure.legend(handles=handles, loc="outside lower center", ncols=6, frameon=False, handlelength=3.2)
    return figure


def _panel(axes: Axes, panel: Panel, looks: Mapping[str, Style]) -> None:
    axes.plot(*panel.common.T, color=FAINT, alpha=0.55, linewidth=9, solid_capstyle="round", zorder=1)
    for law, other in panel.beside.items():
        style = looks[law]
        axes.plot(*other[np.argsort(other[:, 0])].T, style.marker, markersize=_size(style), linewidth=0.7,
                  markerfacecolor="white", zorder=2, **style.line())  # fmt: skip
    for law, cloud in panel.by_law.items():
        style = looks[law]
        on = cloud.values[cloud.front][np.argsort(cloud.values[cloud.front][:, 0])]
        axes.plot(*on.T, linewidth=1.3, zorder=2, **style.line())
        for chosen, opacity in ((cloud.front, 1.0), (~cloud.front, FAINTLY)):
            axes.plot(*cloud.values[chosen].T, style.marker, color=style.colour, markersize=_size(style),
                      markeredgewidth=0.4, markeredgecolor="white", alpha=opacity, zorder=3)  # fmt: skip
        axes.plot(*cloud.values[cloud.begins].T, "o", color=INK, markersize=11, markerfacecolor="none",
                  markeredgewidth=1.1, zorder=4)  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")
    _limits(axes, panel)
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


def _limits(axes: Axes, panel: Panel) -> None:
    """So much that the fronts are seen as far as they are near the best."""
    own = [cloud.values[cloud.front] for cloud in panel.by_law.values()]
    on = np.concatenate([*own, *panel.beside.values()])
    if not len(on):
        return
    near = on[on[:, 1] <= panel.most * on[:, 1].min()]
    axes.set_xlim(near[:, 0].min() / (LEFT if panel.marked else MARGIN), near[:, 0].max() * MARGIN)
    axes.set_ylim(near[:, 1].min() / MARGIN, near[:, 1].max() * MARGIN)
    for axis in (axes.xaxis, axes.yaxis):
        low, high = axis.get_view_interval()
        steps = (1, 2, 5) if high > 10 * low else (1, 1.5, 2, 3, 4, 5, 6, 7, 8, 9)
        ticks = [step * 10.0**power for power in range(-4, 5) for step in steps]
        axis.set_major_locator(FixedLocator([tick for tick in ticks if low <= tick <= high]))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_locator(NullLocator())


def _size(style: Style) -> float:
    return SIZES.get(style.marker, 6.0)
