"""What the figures of runs beside each other have in common."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from spheretwin.viz.compared.colours import run_colours
from spheretwin.viz.compared.run import Run
from spheretwin.viz.figures.plots import FAINT

MOST_POINTS = 3000
"""Of a line: a print of 20 cm has fewer dots."""

DASHES: tuple[Any, ...] = ("-", (0, (5, 1)), (0, (3, 1, 1, 1)), (0, (1, 1)), (0, (7, 2)), (0, (2, 1)))
"""By the place of a run: what tells them apart in grey print."""


class Look(NamedTuple):
    """Of one run."""

    colour: str
    dash: Any

    def line(self) -> dict[str, Any]:
        """For a line of the run."""
        return {"color": self.colour, "linestyle": self.dash, "linewidth": 1.1}


def looks(runs: Sequence[Run]) -> list[Look]:
    """Look of each run."""
    colours = run_colours([run.law for run in runs])
    return [Look(colour, DASHES[place % len(DASHES)]) for place, colour in enumerate(colours)]


def plain(axes: Axes, y: str) -> None:
    """A quantity with its unit at the side, a faint grid behind, no box."""
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
