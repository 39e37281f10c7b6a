"""Style of figures: colours, sizes, grids and legends, the looks of runs and laws, and the files.

Matplotlib is used without its global state. Axes have the colours of the recordings.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.ticker import FixedLocator, NullFormatter, NullLocator
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.files import whole_file
from spheretwin.viz.comparison.runs import ComparedRun
from spheretwin.viz.decimation import envelope
from spheretwin.viz.theme import AXIS_COLOURS, law_colours, law_marks, run_colours

AXES = tuple(f"#{r:02x}{g:02x}{b:02x}" for r, g, b in AXIS_COLOURS)
# Distinct for normal and colour-blind sight: CIE76 differences of 35 and more.
SERIES = ("#648cf0", "#e66e00", "#8c00ff", "#96966e", "#a04682")
INK, FAINT, BROKEN = "#30343a", "#848a93", "#c8102e"

WIDTH_in = 8.0
DPI = 150

PAPER_WIDTHS_in = {"pdf-one-column": 3.5, "pdf-two-columns": 7.16}
"""Width of a figure for one column and for two columns of a paper, by the format that requests it."""
PAPER_SCALE = 0.75
"""Least scale of heights and text in a paper; the layout moves the axes together for the rest."""
PAPER_TEXT_pt = 6.0
"""Least size of text in a paper."""

DASHES: tuple[Any, ...] = (
    "-",
    (0, (5, 1)),
    (0, (3, 1, 1, 1)),
    (0, (1, 1)),
    (0, (9, 2)),
    (0, (2, 1)),
    (0, (7, 1, 1, 1)),
    (0, (4, 1, 1, 1, 1, 1)),
)
"""Dashes by the place of a run: runs are distinct in grey print."""


METADATA: dict[str, dict[str, None]] = {
    "svg": dict.fromkeys(("Creator", "Date", "Format", "Type")),
    "pdf": {"CreationDate": None},
    "png": {"Software": None},
}
"""Entries that are left out of a file, by its format."""


def save(figure: Figure, path: Path, title: str = "") -> None:
    """Write a figure as SVG with real text, as PDF or as PNG; the same figure gives the same bytes.

    Parameters
    ----------
    figure : Figure
    path : Path
        With the suffix of the format.
    title : str
        Description for readers of an SVG who do not see it.

    Raises
    ------
    InputError
        The file cannot be written there.
    """
    kind = path.suffix[1:]
    metadata = METADATA[kind] | ({"Title": title} if title and kind == "svg" else {})
    with (
        whole_file(path) as temporary,
        rc_context({"svg.hashsalt": path.name, "svg.fonttype": "none", "pdf.fonttype": 42}),
    ):
        figure.savefig(temporary, format=kind, dpi=DPI, metadata=metadata)


def fit_width(figure: Figure, width_in: float) -> None:
    """Set the width of a figure for a paper, with legible text: long titles wrap, legends lose columns.

    Parameters
    ----------
    figure : Figure
        With a constrained layout.
    width_in : float, in
    """
    former_in, height_in = figure.get_size_inches()
    scale = float(np.clip(width_in / former_in, PAPER_SCALE, 1.0))
    figure.set_size_inches(width_in, scale * height_in)
    for text in figure.findobj(Text):
        text.set_fontsize(max(PAPER_TEXT_pt, scale * float(text.get_fontsize())))
    titles = list(figure.texts)
    for axes in figure.axes:
        # Also of ticks that are added later.
        axes.tick_params(which="both", labelsize=max(PAPER_TEXT_pt, 8.0 * scale))
        titles += [axes.title, axes.xaxis.label, axes.yaxis.label]
    for title in titles:
        title.set_wrap(True)
    for legend in [legend for legend in figure.legends if legend.get_texts()]:
        _narrow(figure, legend)


def _narrow(figure: Figure, legend: Legend) -> None:
    """Draw a legend below a figure with as many columns as its width has room for."""
    texts = legend.get_texts()
    handles = [handle for handle in legend.legend_handles if handle]
    labels, size_pt = [text.get_text() for text in texts], texts[0].get_fontsize()
    for columns in range(min(len(labels), 5), 0, -1):
        legend.remove()
        legend = figure.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False,
                               fontsize=size_pt, handlelength=legend.handlelength)  # fmt: skip
        figure.draw_without_rendering()
        if legend.get_window_extent().width <= figure.bbox.width:
            return


def faint_grid(axes: Axes, alpha: float = 0.35, **options: Any) -> None:
    """Draw a faint grid behind the data, and remove the box."""
    axes.grid(visible=True, color=FAINT, alpha=alpha, linewidth=0.6, **options)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


MOST_BINS = 1000
"""Bins of a line: a print of 20 cm has few more dots."""


def draw_line(
    axes: Axes, t_s: Array, values: Array, points: int = MOST_BINS, most_bins: int = MOST_BINS, **look: Any
) -> None:
    """Draw every tick, or of a long run the band of the bounds and the mean of every few ticks.

    Both reach from the first tick to the last.

    Parameters
    ----------
    axes : Axes
    t_s, values : (n,) arrays
    points : int
        Ticks up to which each is drawn.
    most_bins : int
        Bins of a longer line.
    **look
        Properties of the line, with its color.
    """
    if len(values) <= points:
        axes.plot(t_s, values, **look)
        return
    bins = envelope(values, most_bins)
    edges_s = np.append(t_s[bins.starts], t_s[-1])
    low, high = (np.append(bound, bound[-1]) for bound in (bins.low, bins.high))
    band: dict[str, Any] = {
        "facecolor": (look["color"], 0.25),
        "edgecolor": (look["color"], 0.6),
        "linewidth": 0.3,
        "label": f"_{look.get('label')}",
    }
    axes.fill_between(edges_s, low, high, step="post", **band)
    middles_s = (edges_s[1:] + edges_s[:-1]) / 2
    means = np.concatenate([values[:1], bins.mean, values[-1:]])
    axes.plot(np.concatenate([t_s[:1], middles_s, t_s[-1:]]), means, **look)


def sheet(
    height_in: float, rows: int = 1, columns: int = 1, title: str = "", width_in: float = WIDTH_in,
    count: int | None = None, **options: Any,
) -> tuple[Figure, NDArray[Any]]:  # fmt: skip
    """Return a figure with a title and its axes by row and column; options as of `Figure.subplots`.

    Axes beyond a count are invisible.
    """
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    if title:
        figure.suptitle(title, fontsize="medium")
    grid: NDArray[Any] = figure.subplots(rows, columns, squeeze=False, **options)
    for spare in grid.flat[grid.size if count is None else count :]:
        spare.set_visible(False)
    return figure, grid


def name_rows(axes: Axes, names: Sequence[str], x: str = "") -> None:
    """Name the rows of a figure from the top, above a logarithmic axis."""
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xscale("log")
    axes.set_xlabel(x)
    faint_grid(axes, axis="x")


def legend_below(
    figure: Figure, panels: Iterable[Axes] = (), ncols: int = 4, more: Iterable[Artist] = (), **options: Any
) -> None:
    """Draw one legend below a figure, of its panels and of more artists: each label once."""
    named: dict[str, Artist] = {}
    for axes in panels:
        handles, labels = axes.get_legend_handles_labels()
        named |= dict(zip(labels, handles, strict=True))
    named |= {str(artist.get_label()): artist for artist in more}
    look = {"loc": "outside lower center", "frameon": False, **options}
    figure.legend(list(named.values()), list(named), ncols=ncols, **look)


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


def plain(axes: Axes, y: str = "", x: str = "", alpha: float = 0.35) -> None:
    """Set quantities with their units as small labels, a faint grid, and no box."""
    axes.set_ylabel(y, fontsize="small")
    if x:
        axes.set_xlabel(x, fontsize="small")
    axes.tick_params(labelsize="small")
    faint_grid(axes, alpha)


REFERENCE: dict[str, Any] = {"color": INK, "linewidth": 0.7, "linestyle": (0, (4, 3))}
"""Properties of the line of a reference, thin and dark over the others."""


def name_axes(axes: Axes, title: str, x: str = "", y: str = "") -> None:
    """Set a title of medium size, and the labels of the axes that are given."""
    axes.set_title(title, fontsize="medium")
    axes.set_xlabel(x or axes.get_xlabel())
    axes.set_ylabel(y or axes.get_ylabel())


def name_runs(figure: Figure, axes: Axes) -> None:
    """Name below a figure what one of its panels has lines of."""
    count = len(axes.get_legend_handles_labels()[1])
    legend_below(figure, [axes], 1 if count > 3 else count, loc="outside lower left", fontsize="small",
                 handlelength=3.4)  # fmt: skip


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


def draw_hollow(axes: Axes, x: Array, y: Array, is_whole: NDArray[np.bool_], style: LawStyle) -> None:
    """Draw the markers of a law, filled or hollow."""
    for whole, inside in ((True, style.colour), (False, "white")):
        chosen = is_whole == whole
        axes.plot(x[chosen], y[chosen], style.marker, color=style.colour, markerfacecolor=inside,
                  markersize=6)  # fmt: skip


def law_keys(
    axes: Axes, labels: Mapping[str, str], size: Callable[[LawStyle], float] | float = 6.0
) -> list[Any]:
    """Return keys of laws for a legend: marker and dash of each."""
    return [
        axes.plot([], [], style.marker, markersize=size(style) if callable(size) else size,
                  label=labels[law], **style.line())[0]
        for law, style in styles(list(labels)).items()
    ]  # fmt: skip


def on_errors(panels: Sequence[Axes], lowest_mrad: float, highest_mrad: float) -> None:
    """Make the y axis of panels in a row one of errors, logarithmic, degrees at the right of the last."""
    degrees = panels[-1].twinx()
    for axes, unit_mrad in (*((panel, 1.0) for panel in panels), (degrees, mrad_per_degree)):
        axes.set_yscale("log")
        axes.set_ylim(lowest_mrad / unit_mrad, highest_mrad / unit_mrad)
        plain_ticks(axes.yaxis, (1,) if highest_mrad > MANY * lowest_mrad else (1, 2, 5))
    for panel in panels:
        faint_grid(panel)
    degrees.set_ylabel("degrees")
    degrees.spines[["top"]].set_visible(False)


def plain_ticks(axis: Axis, steps: Sequence[float]) -> None:
    """Set ticks at some multiples of the powers of ten within a logarithmic axis, as plain numbers."""
    low, high = axis.get_view_interval()
    ticks = [step * 10.0**power for power in range(-4, 5) for step in steps]
    axis.set_major_locator(FixedLocator([tick for tick in ticks if low <= tick <= high]))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
