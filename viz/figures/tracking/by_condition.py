"""Figure of errors over a condition: a panel a hinge, a line a law, and what the paper prints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spheretwin.viz.figures.plots import INK, WIDTH_in
from spheretwin.viz.figures.tracking.style import Style, on_errors, styles

Array = NDArray[np.float64]

MARGIN = 1.25
SHIFT = 0.035
"""Of the steps of x, between the laws: their ranges do not lie upon each other."""


class Series(NamedTuple):
    """Largest errors of one law over the condition."""

    law: str
    values: Array  # (n,)
    error_rad: Array  # (3, n, hinges) lowest, median and highest over the seeds
    whole: NDArray[np.bool_]  # (n,) whether every run came to its end
    paper_rad: Mapping[float, Sequence[float]]  # printed, by the value of the condition


def by_condition(
    by_label: Mapping[str, Series], hinges: Sequence[str], x: str, quantity: str, title: str
) -> Figure:
    """Draw it; hollow where a run did not come to its end, bars where the paper prints a number.

    Parameters
    ----------
    by_label : mapping of label to Series
    hinges : sequence of str
    x, quantity, title : str
    """
    figure = Figure(figsize=(1.2 * WIDTH_in, 4.6), layout="constrained")
    panels = figure.subplots(1, len(hinges), sharey=True, squeeze=False)[0]
    looks = styles([series.law for series in by_label.values()])
    for hinge, (panel, name) in enumerate(zip(panels, hinges, strict=True)):
        for place, (label, series) in enumerate(by_label.items()):
            shift = SHIFT * (place - (len(by_label) - 1) / 2)
            _series(panel, label, series, looks[series.law], hinge, shift)
        panel.set_title(name, fontsize="medium")
        panel.set_xlabel(x)
        panel.set_xticks(next(iter(by_label.values())).values)
    every = [np.ravel(series.error_rad) for series in by_label.values()]
    every += [np.ravel(list(series.paper_rad.values())) for series in by_label.values()]
    errors = 1e3 * np.concatenate(every)
    errors = errors[np.isfinite(errors)]
    on_errors(panels, errors.min() / MARGIN, errors.max() * MARGIN)
    panels[0].set_ylabel(f"{quantity}, mrad")
    _legend(figure, panels[0], by_label)
    figure.suptitle(title, fontsize="medium")
    return figure


def _series(panel: Axes, label: str, series: Series, style: Style, hinge: int, shift: float) -> None:
    step = np.min(np.diff(series.values)) if len(series.values) > 1 else 1.0
    x = series.values + shift * step
    low, middle, high = 1e3 * series.error_rad[:, :, hinge]
    panel.plot(x, middle, label=label, linewidth=1.5, **style.line())
    panel.errorbar(x, middle, [middle - low, high - middle], fmt="none", ecolor=style.colour, capsize=2.5,
                   elinewidth=1)  # fmt: skip
    for whole, inside in ((True, style.colour), (False, "white")):
        chosen = series.whole == whole
        panel.plot(x[chosen], middle[chosen], style.marker, color=style.colour, markerfacecolor=inside,
                   markersize=6)  # fmt: skip
    for value, printed in series.paper_rad.items():
        at = value + shift * step
        ours = middle[np.isclose(series.values, value)]
        paper = 1e3 * printed[hinge]
        panel.plot([at, at], [paper, *ours], color=style.colour, linewidth=0.9, linestyle=":")
        panel.plot(at, paper, "_", color=INK, markersize=17, markeredgewidth=4.2)
        panel.plot(at, paper, "_", color=style.colour, markersize=15, markeredgewidth=2.4)
        panel.plot(at, paper, style.marker, color="white", markersize=4.5, markeredgecolor=INK)


def _legend(figure: Figure, panel: Axes, by_label: Mapping[str, Series]) -> None:
    looks = styles([series.law for series in by_label.values()])
    handles = [
        panel.plot([], [], style.marker, markersize=6, label=label, **style.line())[0]
        for label, style in zip(by_label, looks.values(), strict=True)
    ]
    if any(series.paper_rad for series in by_label.values()):
        handles += panel.plot([], [], "_", color=INK, markersize=15, markeredgewidth=3, label="printed")
    if not all(series.whole.all() for series in by_label.values()):
        hollow: dict[str, Any] = {"color": INK, "markerfacecolor": "white", "linestyle": "", "marker": "o"}
        handles += panel.plot([], [], label="ended early", markersize=6, **hollow)
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 6), frameon=False,
                  handlelength=3.2)  # fmt: skip
