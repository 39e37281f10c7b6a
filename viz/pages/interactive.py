"""Figures of Matplotlib with zoom, hover and switches of the runs, and the page that holds them."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as plotly
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection, QuadMesh
from matplotlib.colors import to_hex, to_rgba
from matplotlib.lines import Line2D

from spheretwin.models.base.arrays import Array
from spheretwin.viz.comparison.runs import ComparedRun, Spectrum
from spheretwin.viz.figures import comparison
from spheretwin.viz.figures.style import DASHES
from spheretwin.viz.pages import markdown
from spheretwin.viz.pages.markdown import BLOCK
from spheretwin.viz.quantities import Quantity
from spheretwin.viz.theme import run_colours

# The browser contacts no host.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:;"
    " font-src data:; form-action 'none'; base-uri 'none'"
)

LIBRARY = Path(__file__).with_name("plotly-cartesian.min.js.gz")
"""Part of Plotly's JavaScript that draws these figures, as its authors publish it: npm, 4.1.1, MIT licence.

The Python package has only all of it, which is three times as large.
"""

OVER_TIME, SPECTRA, RUNS = "over-time", "spectra", "runs"
"""Names of the figures and of the switches of the runs."""


def place(name: str) -> str:
    """Return the Markdown at whose place a page has a figure, or the switches."""
    return f"![{name}]({BLOCK}{name})"


def page(
    title: str, text: str, runs: Sequence[ComparedRun], over_time: plotly.Figure, spectra: plotly.Figure
) -> str:
    """Whole page.

    Parameters
    ----------
    title : str
    text : str
        Markdown with the places of figures and switches.
    runs : sequence of ComparedRun
    over_time, spectra : Figure
    """
    figures = {OVER_TIME: over_time, SPECTRA: spectra}
    blocks = {f"{BLOCK}{name}": f'<div class="plot" id="{name}"></div>\n' for name in figures}
    switches = f'<div class="runs" role="group" aria-label="runs">{_switches(runs)}</div>\n'
    blocks[f"{BLOCK}{RUNS}"] = switches
    content = ", ".join(f'"{name}": {figure.to_json()}' for name, figure in figures.items())
    scripts = [
        f'<script type="text/plain" id="library">{base64.b64encode(LIBRARY.read_bytes()).decode()}</script>',
        # No text of a user's ends the script.
        f"<script>const figures = {{{content}}};".replace("<", "\\u003c").replace("\\u003c", "<", 1),
        f"\n{markdown.shipped_text('interactive.js')}</script>\n",
    ]
    style = markdown.shipped_text("interactive.css")
    head = f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n<style>\n{style}</style>'
    return markdown.page(title, text, blocks.__getitem__, head, "\n".join(scripts))


def _switches(runs: Sequence[ComparedRun]) -> str:
    colours = run_colours([run.law for run in runs])
    return "".join(
        f'<button type="button" data-run="{place}" aria-pressed="true"><svg width="32" height="6">'
        f'<line y1="3" x2="32" y2="3" stroke="{colour}" stroke-width="3"'
        f' stroke-dasharray="{_dash(place)}"/></svg>{escape(run.label)}</button>'
        for place, (run, colour) in enumerate(zip(runs, colours, strict=True))
    )


FAINT, INK = "#e3e6ea", "#30343a"

HEIGHT_px, GAP_px, MARGIN_px, NOTE_px = 150, 26, 46, 14


class PlotPanel(NamedTuple):
    """Panel of a figure."""

    title: str
    """Title with its unit."""
    traces: Sequence[Any]
    axis: dict[str, Any]
    """Properties of its vertical axis besides those of all panels."""
    height: float = 1.0
    """Height relative to an ordinary panel."""
    note: Sequence[str] = ()
    """Lines between title and panel: the values that its axis leaves out."""


def stacked(panels: Sequence[PlotPanel], x: str, **axis: Any) -> plotly.Figure:
    """Figure of panels.

    Parameters
    ----------
    panels : sequence of PlotPanel
    x : str
        Label of the common axis, with its unit.
    **axis
        Properties of the axis besides the common ones.
    """
    inner_px = sum(panel.height * HEIGHT_px + GAP_px + NOTE_px * len(panel.note) for panel in panels)
    figure, top = plotly.Figure(), 1.0
    for place, panel in enumerate(panels):
        name = _axis(place)
        note_px = NOTE_px * len(panel.note)
        top -= note_px / inner_px
        bottom = top - panel.height * HEIGHT_px / inner_px
        looks = {"gridcolor": FAINT, "zerolinecolor": FAINT, "linecolor": INK, "tickfont_size": 11}
        figure.layout[name] = {"domain": (max(bottom, 0.0), top), **looks, **panel.axis}
        for trace in panel.traces:
            trace.update(xaxis="x", yaxis=_anchor(place))
            figure.add_trace(trace)
        above = {"xref": "paper", "yref": "paper", "y": top, "yanchor": "bottom", "showarrow": False}
        left = {"x": 0, "xanchor": "left"}
        shift = {"yshift": note_px} if panel.note else {}
        figure.add_annotation(text=f"<b>{panel.title}</b>", font_size=12, **above, **left, **shift)
        if panel.note:
            note = {"text": "<br>".join(panel.note), "align": "left", "font_size": 10, **left}
            figure.add_annotation(name=name, **above, **note)
        top = bottom - GAP_px / inner_px
    spikes = {"showspikes": True, "spikemode": "across", "spikesnap": "cursor", "spikethickness": 1}
    figure.update_layout(
        template="none",
        height=inner_px + 2 * MARGIN_px,
        margin={"l": 64, "r": 16, "t": MARGIN_px, "b": MARGIN_px},
        font={"family": "system-ui, sans-serif", "color": INK},
        showlegend=False,
        hovermode="x",
        hoversubplots="axis",
        hoverlabel={"font_size": 11, "namelength": 0},
        xaxis={"title": {"text": x}, "anchor": _anchor(len(panels) - 1), "gridcolor": FAINT, **spikes,
               **axis, "spikecolor": INK, "spikedash": "dot", "linecolor": INK, "zeroline": False},
    )  # fmt: skip
    return figure


def _axis(place: int) -> str:
    """Return the name of the vertical axis of a panel, by its place from 0."""
    return f"yaxis{place + 1}" if place else "yaxis"


def _anchor(place: int) -> str:
    """Return how traces and the other axis name that axis."""
    return _axis(place).replace("axis", "")


MOST_NUMBERS = 130_000
"""Numbers in all lines; each takes five to six bytes of the page, in addition to the library's 0.7 MB."""

MOST_POINTS, FEWEST_POINTS = 20_000, 300
NUMBERS_OF_A_BIN = 8
MOST_COLUMNS, MOST_CURRENTS = 500, 30_000
MOST_LINES_EACH_OCTAVE, FEWEST_LINES_EACH_OCTAVE = 48, 8
LINES_OF_ALL = 288


def over_time(
    runs: Sequence[ComparedRun], leading: Sequence[int], quantities: Sequence[Quantity]
) -> plotly.Figure:
    """Figure of every quantity, the currents of each run and the events.

    Parameters
    ----------
    runs : sequence of ComparedRun
    leading : sequence of int
        Places of the runs that show the reference.
    quantities : sequence of Quantity
    """
    most = int(np.clip(points_per_line(runs, leading, quantities), FEWEST_POINTS, MOST_POINTS))
    detail = comparison.Detail(most, most // NUMBERS_OF_A_BIN)
    groups = runs[0].table["current_A"].shape[1]
    cells = min(MOST_COLUMNS, MOST_CURRENTS // (groups * len(runs)))
    drawn = [
        comparison.over_time(runs, leading, quantities, "", detail).axes,
        comparison.currents(runs, "", cells).axes,
    ]
    panels = [_panel(axes, runs) for of_figure in drawn for axes in of_figure if axes.get_subplotspec()]
    return stacked([*panels, _events(runs)], "time [s]")


def points_per_line(
    runs: Sequence[ComparedRun], leading: Sequence[int], quantities: Sequence[Quantity]
) -> int:
    """Points that each line may have."""
    lines = sum(len(runs) + (len(leading) if quantity.desired else 0) for quantity in quantities)
    return MOST_NUMBERS // max(lines, 1)


def error_spectra(runs: Sequence[ComparedRun], spectra: Sequence[Sequence[Spectrum]]) -> plotly.Figure:
    """Figure of the errors' spectra.

    Parameters
    ----------
    runs : sequence of ComparedRun
    spectra : sequence of sequence of Spectrum
        Spectra of each run and each hinge.
    """
    each_octave = LINES_OF_ALL // len(runs)
    each_octave = int(np.clip(each_octave, FEWEST_LINES_EACH_OCTAVE, MOST_LINES_EACH_OCTAVE))
    axes_of_hinges = comparison.spectra(runs, spectra, "", each_octave).axes
    figure = stacked([_panel(axes, runs) for axes in axes_of_hinges], "frequency [Hz]", type="log")
    hover = "%{x:.4g} Hz: %{y:.3g} mrad<extra></extra>"
    return figure.update_traces(hovertemplate=hover, selector={"mode": "lines"})


def _panel(axes: Axes, runs: Sequence[ComparedRun]) -> PlotPanel:
    """Panel with the lines, bands, markers and images of axes; those of a run have its label."""
    places = {label: place for place, run in enumerate(runs) for label in (run.label, run.legend)}
    traces = [
        trace
        for artist in axes.get_children()
        for trace in _traces(artist, places.get(str(artist.get_label()).removeprefix("_")))
    ]
    is_log, heading = axes.get_yscale() == "log", axes.get_title(loc="left") or axes.get_ylabel()
    axis: dict[str, Any] = {"type": "log", "exponentformat": "power"} if is_log else {}
    if not axes.get_autoscaley_on():
        axis["range"] = np.log10(axes.get_ylim()).tolist() if is_log else axes.get_ylim()
    for image in axes.collections:
        if isinstance(image, QuadMesh):
            heading = f"{heading or axes.get_yticklabels()[0].get_text()}, up to {image.get_clim()[1]:.3g} A"
            axis["tickvals"] = axes.get_yticks()[: np.shape(image.get_coordinates())[0] - 2].tolist()
    place, note = axes.get_subplotspec(), axes.get_title(loc="right").splitlines()
    ratios = np.asarray(place.get_gridspec().get_height_ratios() if place else [1.0], dtype=np.float64)
    height = max(float(ratios[place.rowspan.start if place else 0] / ratios.max()), 0.25)
    return PlotPanel(_text(heading.replace("\n", " ")), traces, axis, height, note)


SYMBOLS = {"o": "circle", "X": "x"}


def _traces(artist: Artist, run: int | None) -> list[Any]:
    """Traces of one artist, switched with its run; none of one without data."""
    common: dict[str, Any] = {} if run is None else {"meta": f"{run}"}
    if isinstance(artist, Line2D):
        x, y = map(np.asarray, artist.get_data())
        if not len(x):
            return []
        colour, marker = to_hex(artist.get_color()), SYMBOLS.get(str(artist.get_marker()))
        if marker:
            look = {"color": colour, "size": 8, "symbol": marker}
            return [plotly.Scatter(x=x, y=y, mode="markers", marker=look, hoverinfo="skip", **common)]
        dash = "dash" if run is None else (_dash(run).replace(",", "px,") + "px" if _dash(run) else "solid")
        line = {"color": colour, "width": 1.2 * artist.get_linewidth(), "dash": dash}
        hover = {"hoverinfo": "skip"} if run is None else {"hovertemplate": "%{y:.4g}<extra></extra>"}
        return [plotly.Scatter(**_places(x), y=_small(y), mode="lines", line=line, **hover, **common)]
    if isinstance(artist, QuadMesh):
        corners, values = np.asarray(artist.get_coordinates()), np.asarray(artist.get_array())
        (low, high), shades = artist.get_clim(), np.linspace(0, 1, 11)
        mesh = {"x": _small(corners[0, :, 0]), "y": corners[:, 0, 1], "z": _small(values)}
        scale = [[shade, to_hex(artist.cmap(shade))] for shade in shades.tolist()]
        group = "group %{y:.0f}: " if len(corners) > 2 else ""
        text: dict[str, Any] = {"hovertemplate": group + "%{z:.3g} A<extra></extra>", "showscale": False}
        return [plotly.Heatmap(**mesh, zmin=low, zmax=high, colorscale=scale, **text, **common)]
    if isinstance(artist, PolyCollection):
        ends = np.full((1, 2), np.nan)
        outlines = [part for path in artist.get_paths() for part in (path.vertices, ends)]
        x, y = np.concatenate([*outlines, ends]).T
        fill = [_rgba(colours[0]) for colours in (artist.get_facecolor(), artist.get_edgecolor())]
        edge = {"color": fill[1], "width": 0.5}
        return [plotly.Scatter(x=_small(x), y=_small(y), mode="lines", line=edge, fill="toself",
                               fillcolor=fill[0], hoverinfo="skip", **common)]  # fmt: skip
    return []


def _dash(place: int) -> str:
    """Dash of a run in the notation of an SVG: colours alone are too alike for some readers."""
    dash = DASHES[place % len(DASHES)]
    return "" if dash == "-" else ",".join(f"{1.5 * length:g}" for length in dash[1])


def _rgba(colour: Any) -> str:
    *shades, alpha = to_rgba(colour)
    return f"rgba({','.join(f'{255 * shade:.0f}' for shade in shades)},{alpha:g})"


def _places(x: Array) -> dict[str, Any]:
    """Horizontal places of points; if they have one distance, the first and the distance are enough."""
    steps = np.diff(x)
    is_even = len(steps) > 1 and np.allclose(steps, steps[0], rtol=1e-6)
    return {"x0": float(x[0]), "dx": float(steps.mean())} if is_even else {"x": _small(x)}


def _events(runs: Sequence[ComparedRun]) -> PlotPanel:
    """A row a run, a mark an event."""
    traces = []
    for place, (run, colour) in enumerate(zip(runs, run_colours([run.law for run in runs]), strict=True)):
        times = [event[0] for event in run.events]
        text = [_text(f"{t_s:.4g} s: {text}") for t_s, _, text in run.events]
        symbols = ["circle" if level == "INFO" else "triangle-up" for _, level, _ in run.events]
        traces.append(plotly.Scatter(x=times, y=[place + 1] * len(times), mode="markers", text=text,
                                     marker={"color": colour, "size": 9, "symbol": symbols},
                                     meta=f"{place}", hovertemplate="%{text}<extra></extra>"))  # fmt: skip
    axis = {"range": (len(runs) + 0.6, 0.4), "dtick": 1, "fixedrange": True}
    return PlotPanel("events, by run", traces, axis, height=0.25 + 0.15 * len(runs))


def _small(values: Array) -> np.ndarray:
    """Halve the bytes: seven digits are more than a plot shows."""
    return np.ascontiguousarray(values, dtype=np.float32)


def _text(text: str) -> str:
    """Escape all tags; quotes stay, because the library would show their escapes."""
    return escape(text, quote=False)
