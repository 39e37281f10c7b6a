"""How laws are told apart, and an axis of errors that reads in mrad at its left, in degrees at its right."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, NullFormatter, NullLocator
from numpy.typing import NDArray

from spheretwin.viz.figures.plots import FAINT
from spheretwin.viz.palette import law_colours, law_marks

Array = NDArray[np.float64]

mrad_per_degree = 1e3 * np.pi / 180
MANY = 2000.0
"""Ratio of an axis from which on whole powers of ten are ticks enough."""


class Style(NamedTuple):
    """Of one law."""

    colour: str
    marker: str
    dash: Any

    def line(self) -> dict[str, Any]:
        """For a line without markers."""
        return {"color": self.colour, "linestyle": self.dash}


def styles(laws: Sequence[str]) -> dict[str, Style]:
    """Colour, marker and dash of each law."""
    colours, marks = law_colours(laws), law_marks(laws)
    return {law: Style(colours[law], *marks[law]) for law in laws}


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
    wanted = [tick for tick in ticks if lowest <= tick <= highest]
    axes.yaxis.set_major_locator(FixedLocator(wanted))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_minor_formatter(NullFormatter())
