"""The figures of the page: all over time in one, spectra of the errors in another."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as plotly
from plotly.offline import get_plotlyjs

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.viz.comparison.runs import ComparedRun, Spectrum, logarithmic_range, quantity_range
from spheretwin.viz.decimation import envelope, mean_and_deviation, octave_maxima
from spheretwin.viz.pages import markdown
from spheretwin.viz.quantities import Array, Quantity
from spheretwin.viz.theme import rgb, run_colours

# The browser contacts no host.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:;"
    " font-src data:; form-action 'none'; base-uri 'none'"
)


SCALE = (
    '<button type="button" id="logarithmic" aria-pressed="false">logarithmic axis of the error angle</button>'
)

TITLES = {"over-time": "Signals over time", "spectra": "Spectra of the tracking errors"}
"""Heading of each figure."""


def page(
    title: str,
    runs: Sequence[ComparedRun],
    over_time: plotly.Figure,
    spectra: plotly.Figure,
    above: str,
    below: str,
) -> str:
    """Whole page.

    Parameters
    ----------
    title : str
    runs : sequence of ComparedRun
    over_time, spectra : Figure
    above, below : str
        Markdown above and below the figures.
    """
    figures = {"over-time": over_time, "spectra": spectra}
    content = ", ".join(f'"{name}": {figure.to_json()}' for name, figure in figures.items())
    body = [
        markdown.rendered(above),
        f'<div class="runs" role="group" aria-label="runs">{_switches(runs)}{SCALE}</div>',
        *(
            markdown.rendered(f"## {TITLES[name]}") + f'<div class="plot" id="{name}"></div>'
            for name in figures
        ),
        markdown.rendered(below),
        f"<script>{get_plotlyjs()}</script>",
        # No text of a user's ends the script.
        f"<script>const figures = {{{content}}};".replace("<", "\\u003c").replace("\\u003c", "<", 1),
        f"\n{markdown.shipped_text('interactive.js')}</script>\n",
    ]
    style = markdown.shipped_text("interactive.css")
    head = f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n<style>\n{style}</style>'
    return markdown.whole(title, "\n".join(body), head)


def _switches(runs: Sequence[ComparedRun]) -> str:
    colours = run_colours([run.law for run in runs])
    return "".join(
        f'<button type="button" data-run="{place}" aria-pressed="true"><svg width="32" height="6">'
        f'<line y1="3" x2="32" y2="3" stroke="{colour}" stroke-width="3"'
        f' stroke-dasharray="{DASHES_px[place % len(DASHES_px)]}"/></svg>{escape(run.label)}</button>'
        for place, (run, colour) in enumerate(zip(runs, colours, strict=True))
    )


FAINT, INK, REFERENCE_COLOUR = "#e3e6ea", "#30343a", "#9aa1ab"

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
"""Numbers in all lines; each takes five to six bytes of the page, in addition to the library's 4.8 MB."""

MOST_POINTS, FEWEST_POINTS = 20_000, 300
MOST_COLUMNS, MOST_CURRENTS = 500, 30_000
MOST_LINES_EACH_OCTAVE, FEWEST_LINES_EACH_OCTAVE = 48, 8
LINES_OF_ALL = 288

BLUE_TO_RED = [[0, "#2166ac"], [0.5, "#f7f7f7"], [1, "#b2182b"]]


def over_time(
    runs: Sequence[ComparedRun], leading: Sequence[int], quantities: Sequence[Quantity]
) -> plotly.Figure:
    """Figure of every quantity, the currents of each run and what happened.

    Parameters
    ----------
    runs : sequence of ComparedRun
    leading : sequence of int
        Places of the runs that show the reference.
    quantities : sequence of Quantity
    """
    most = int(np.clip(points_per_line(runs, leading, quantities), FEWEST_POINTS, MOST_POINTS))
    colours = run_colours([run.law for run in runs])
    panels: list[PlotPanel] = []
    logarithmic: list[dict[str, Any]] = []
    for quantity in quantities:
        reference_lines = [
            trace
            for place in leading
            if quantity.desired
            for trace in _lines(
                runs[place],
                place,
                quantity.desired(runs[place].rows),
                most,
                {"color": REFERENCE_COLOUR, "width": 4.0},
            )
        ]
        of_runs = [quantity.column(run.rows) for run in runs]
        lines = [
            trace
            for place, (run, colour, values) in enumerate(zip(runs, colours, of_runs, strict=True))
            for trace in _lines(run, place, values, most, _line(place, colour))
        ]
        for trace in reference_lines:
            trace.hoverinfo, trace.hovertemplate = "skip", None
        limits = quantity_range(quantity, runs, leading)
        axis, note = {"range": (limits.low, limits.high)}, limits.outside_lines()
        if quantity.group == "whole":
            other = logarithmic_range(of_runs)
            note, other_note = _of_same_length(note, other.outside_lines())
            ends = np.log10([other.low, other.high]).tolist()
            logarithmic.append({"axis": _axis(len(panels)), "range": ends, "note": "<br>".join(other_note)})
        panels.append(PlotPanel(_text(quantity.heading), [*reference_lines, *lines], axis, note=note))
    panels += _currents(runs)
    panels.append(_events(runs, colours))
    figure = stacked(panels, "time [s]")
    figure.layout.meta = logarithmic
    return figure


def _of_same_length(*notes: Sequence[str]) -> list[list[str]]:
    """Return notes with as many lines each: the panel has the space of the longest."""
    most = max(map(len, notes))
    return [[*lines, *[" "] * (most - len(lines))] for lines in notes]


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
    colours, panels = run_colours([run.law for run in runs]), []
    lines_per_octave = int(
        np.clip(LINES_OF_ALL // len(runs), FEWEST_LINES_EACH_OCTAVE, MOST_LINES_EACH_OCTAVE)
    )
    for axis, name in enumerate(ANGLES):
        traces = []
        for place, (colour, of_run) in enumerate(zip(colours, spectra, strict=True)):
            spectrum, look = of_run[axis], _line(place, colour)
            x, y = octave_maxima(spectrum.frequency_Hz, spectrum.amplitude_mrad, lines_per_octave)
            hover = "%{x:.4g} Hz: %{y:.3g} mrad<extra></extra>"
            traces.append(plotly.Scatter(x=_small(x), y=_small(y), mode="lines", line=look,
                                         meta=f"{place}", hovertemplate=hover))  # fmt: skip
            tops = np.array(spectrum.peaks).reshape(-1, 2).T
            traces.append(plotly.Scatter(x=tops[0], y=tops[1], mode="markers", hoverinfo="skip",
                                         marker={"color": colour, "size": 8}, meta=f"{place}"))  # fmt: skip
        panels.append(
            PlotPanel(
                f"error of {name}, amplitude [mrad]", traces, {"type": "log", "exponentformat": "power"}
            )
        )
    return stacked(panels, "frequency [Hz]", type="log")


DASHES_px = ("", "7,3", "2,2", "7,2,2,2", "12,3", "12,2,2,2", "4,4", "2,5")
"""Dash of each run, as an SVG writes it: colours alone are too alike for some readers."""


def _line(place: int, colour: str) -> dict[str, Any]:
    """Return the look of the lines of a run."""
    dash = DASHES_px[place % len(DASHES_px)]
    return {"color": colour, "width": 1.3, "dash": dash.replace(",", "px,") + "px" if dash else "solid"}


def _lines(
    run: ComparedRun, place: int, values: Array, most: int, line: dict[str, Any]
) -> list[plotly.Scatter]:
    """Return every tick as one line, or the bounds of every few ticks as a band and their mean."""
    t_s, colour = run.table["t_s"], line["color"]
    common = {"mode": "lines", "meta": f"{place}"}
    hover = "%{y:.4g}<extra></extra>"
    if len(values) <= most:
        return [plotly.Scatter(x0=float(t_s[0]), dx=run.period_s, y=_small(values), line=line,
                               hovertemplate=hover, **common)]  # fmt: skip
    bins = envelope(values, most // 3)
    width_s = run.period_s * int(bins.starts[1])
    step = {"x0": float(t_s[0]), "dx": width_s, "hoverinfo": "skip"}
    edge = {"color": colour, "width": 0.5, "shape": "hv"}
    low, high = (np.append(bound, bound[-1]) for bound in (bins.low, bins.high))
    band = {"fill": "tonexty", "fillcolor": f"rgba{(*rgb(colour), 0.3)}"}
    middles_s = np.concatenate([t_s[bins.starts[:-1]] + width_s / 2, t_s[-1:]])
    return [
        plotly.Scatter(y=_small(low), line=edge, **step, **common),
        plotly.Scatter(y=_small(high), line=edge, **step, **band, **common),
        plotly.Scatter(x=_small(middles_s), y=_small(bins.mean), line=line, hovertemplate=hover, **common),
    ]


def _currents(runs: Sequence[ComparedRun]) -> list[PlotPanel]:
    """Return a panel for each run: mean currents, blue negative and red positive, and a row of variation."""
    largest_A = max(float(np.nanmax(np.abs(run.table["current_A"]))) for run in runs)
    panels = []
    for place, run in enumerate(runs):
        groups = run.table["current_A"].shape[1]
        most = min(MOST_COLUMNS, MOST_CURRENTS // (groups * len(runs)))
        cells = mean_and_deviation(run.table["current_A"], most)
        ends_s = np.append(run.table["t_s"][cells.starts], run.table["t_s"][-1] + run.period_s)
        common = {"x": _small(ends_s), "showscale": False, "meta": f"{place}"}
        hover = "group %{y}: mean %{z:.3g} A<extra></extra>"
        means = plotly.Heatmap(z=_small(cells.mean.T), colorscale=BLUE_TO_RED, zmin=-largest_A,
                               zmax=largest_A, hovertemplate=hover, **common)  # fmt: skip
        hover = "standard deviation up to %{z:.3g} A<extra></extra>"
        lane = plotly.Heatmap(z=_small(np.max(cells.deviation, axis=1)[None]), y=[groups + 0.5], dy=1.0,
                              colorscale="Greys", zmin=0.0, zmax=largest_A / 2, hovertemplate=hover,
                              **common)  # fmt: skip
        title = f"mean currents by group up to ±{largest_A:.3g} A, below their variation: {_text(run.legend)}"
        panels.append(
            PlotPanel(title, [means, lane], {"range": (groups + 1, -0.5), "dtick": max(1, groups // 6)})
        )
    return panels


def _events(runs: Sequence[ComparedRun], colours: Sequence[str]) -> PlotPanel:
    """A row a run, a mark an event."""
    traces = []
    for place, (run, colour) in enumerate(zip(runs, colours, strict=True)):
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
