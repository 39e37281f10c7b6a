"""Figure of errors over printed ones: a row a reading, a marker a number, a line at 1."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spheretwin.viz.figures.plots import FAINT, INK, WIDTH_in
from spheretwin.viz.figures.tracking.style import styles

Array = NDArray[np.float64]

ROW_in = 0.5


class Row(NamedTuple):
    """One reading."""

    label: str
    by_law: Mapping[str, Array]  # (n,) ratios of each law


def ratios(rows: Sequence[Row], labels: Mapping[str, str], quantity: str, title: str) -> Figure:
    """Draw them on a logarithmic axis, the laws of a row below each other.

    Parameters
    ----------
    rows : sequence of Row
    labels : mapping of law to label
    quantity, title : str
    """
    figure = Figure(figsize=(WIDTH_in, 1.5 + ROW_in * len(rows)), layout="constrained")
    axes = figure.subplots()
    looks = styles(list(labels))
    for y, row in enumerate(rows):
        for place, (law, values) in enumerate(row.by_law.items()):
            style = looks[law]
            at = y + 0.22 * (place - (len(row.by_law) - 1) / 2)
            axes.plot([values.min(), values.max()], [at, at], color=style.colour, linewidth=1.2)
            axes.plot(values, np.full(len(values), at), style.marker, color=style.colour, markersize=5,
                      alpha=0.8, label=labels[law] if y == 0 else None)  # fmt: skip
    axes.axvline(1.0, color=INK, linewidth=1.2, linestyle="--", label="the paper")
    axes.set_xscale("log")
    axes.set_yticks(range(len(rows)), [row.label for row in rows])
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xlabel(quantity)
    axes.set_title(title, fontsize="medium")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.grid(visible=True, axis="x", color=FAINT, alpha=0.35, linewidth=0.6)
    for y in range(1, len(rows)):
        axes.axhline(y - 0.5, color=FAINT, linewidth=0.4)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside lower center", ncols=4, frameon=False)
    return figure
