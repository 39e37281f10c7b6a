"""A figure of a page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullFormatter, NullLocator
from numpy.typing import NDArray

from spheretwin.viz.comparison.runs import ComparedRun, run_colours
from spheretwin.viz.figures.crosscheck import FAINT
from spheretwin.viz.theme import law_colours, law_marks

if TYPE_CHECKING:
    from matplotlib.figure import Figure


MOST_POINTS = 3000
"""Points of a line: a print of 20 cm has fewer dots."""

DASHES: tuple[Any, ...] = ("-", (0, (5, 1)), (0, (3, 1, 1, 1)), (0, (1, 1)), (0, (7, 2)), (0, (2, 1)))
"""Dashes by the place of a run: runs are distinct in grey print."""


class RunStyle(NamedTuple):
    """Colour and dash of one run."""

    colour: str
    dash: Any

    def line(self) -> dict[str, Any]:
        """Return the properties of a line of the run."""
        return {"color": self.colour, "linestyle": self.dash, "linewidth": 1.1}


def run_styles(runs: Sequence[ComparedRun]) -> list[RunStyle]:
    """Look of each run."""
    colours = run_colours([run.law for run in runs])
    return [RunStyle(colour, DASHES[place % len(DASHES)]) for place, colour in enumerate(colours)]


def plain(axes: Axes, y: str) -> None:
    """Set a quantity with its unit as the label, a faint grid, and no box."""
    axes.set_ylabel(y, fontsize="small")
    axes.tick_params(labelsize="small")
    axes.grid(visible=True, color=FAINT, alpha=0.35, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def name_runs(figure: Figure, axes: Axes) -> None:
    """Name below a figure what one of its panels has lines of."""
    lines, labels = axes.get_legend_handles_labels()
    figure.legend(lines, labels, loc="outside lower left", ncols=1 if len(labels) > 3 else len(labels),
                  frameon=False, fontsize="small", handlelength=3.4)  # fmt: skip


Array = NDArray[np.float64]

mrad_per_degree = 1e3 * np.pi / 180
MANY = 2000.0
"""Ratio of an axis beyond which ticks at whole powers of ten are enough."""


class LawStyle(NamedTuple):
    """Colour, marker and dash of one law."""

    colour: str
    marker: str
    dash: Any

    def line(self) -> dict[str, Any]:
        """Return the properties of a line without markers."""
        return {"color": self.colour, "linestyle": self.dash}


def styles(laws: Sequence[str]) -> dict[str, LawStyle]:
    """Colour, marker and dash of each law."""
    colours, marks = law_colours(laws), law_marks(laws)
    return {law: LawStyle(colours[law], *marks[law]) for law in laws}


def on_errors(panels: Sequence[Axes], lowest_mrad: float, highest_mrad: float) -> None:
    """Make the y axis of panels in a row one of errors, logarithmic, degrees at the right of the last."""
    for panel in panels:
        panel.set_yscale("log")
        panel.set_ylim(lowest_mrad, highest_mrad)
        _ticks(panel, lowest_mrad, highest_mrad)
        panel.grid(visible=True, color=FAINT, alpha=0.35, linewidth=0.6)
        panel.set_axisbelow(True)
        panel.spines[["top", "right"]].set_visible(False)
    degrees = panels[-1].twinx()
    degrees.set_yscale("log")
    degrees.set_ylim(lowest_mrad / mrad_per_degree, highest_mrad / mrad_per_degree)
    _ticks(degrees, *degrees.get_ylim())
    degrees.set_ylabel("degrees")
    degrees.spines[["top"]].set_visible(False)


def _ticks(axes: Axes, lowest: float, highest: float) -> None:
    steps = (1,) if highest > MANY * lowest else (1, 2, 5)
    ticks = [step * 10.0**power for power in range(-4, 5) for step in steps]
    shown = [tick for tick in ticks if lowest <= tick <= highest]
    axes.yaxis.set_major_locator(FixedLocator(shown))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_minor_formatter(NullFormatter())
