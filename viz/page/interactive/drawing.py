"""The figures of the page: all over time in one, spectra of the errors in another."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np
import plotly.graph_objects as plotly

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.viz.compared.colours import run_colours
from spheretwin.viz.compared.quantities import Quantity
from spheretwin.viz.compared.run import Run
from spheretwin.viz.compared.spectrum import Spectrum
from spheretwin.viz.compared.thinning import highest_by_octave, strongest, thinned
from spheretwin.viz.page.interactive.panels import ASKED, Panel, stacked
from spheretwin.viz.quantities.quantity import Array

MOST_NUMBERS = 130_000
"""In all lines; each takes five to six bytes of the page, beside the library's 4.8 MB."""

MOST_POINTS, FEWEST_POINTS = 20_000, 300
MOST_COLUMNS, MOST_CURRENTS = 500, 30_000
MOST_LINES_EACH_OCTAVE, FEWEST_LINES_EACH_OCTAVE = 48, 8
LINES_OF_ALL = 288

BLUE_TO_RED = [[0, "#2166ac"], [0.5, "#f7f7f7"], [1, "#b2182b"]]


def over_time(runs: Sequence[Run], leading: Sequence[int], quantities: Sequence[Quantity]) -> plotly.Figure:
    """Figure of every quantity, the currents of each run and what happened.

    Parameters
    ----------
    runs : sequence of Run
    leading : sequence of int
        Places of the runs that show what was asked for.
    quantities : sequence of Quantity
    """
    most = int(np.clip(points_each(runs, leading, quantities), FEWEST_POINTS, MOST_POINTS))
    colours = run_colours([run.law for run in runs])
    panels = []
    for quantity in quantities:
        asked = [
            _line(runs[place], place, quantity.desired(runs[place].rows), most, ASKED, 4.0)
            for place in leading
            if quantity.desired
        ]
        lines = [
            _line(run, place, quantity.of(run.rows), most, colour, 1.3)
            for place, (run, colour) in enumerate(zip(runs, colours, strict=True))
        ]
        for trace in asked:
            trace.hoverinfo, trace.hovertemplate = "skip", None
        axis = {"range": quantity.limits} if quantity.limits else {}
        panels.append(Panel(_text(quantity.heading), [*asked, *lines], axis))
    panels += _currents(runs)
    panels.append(_happened(runs, colours))
    return stacked(panels, "time [s]")


def points_each(runs: Sequence[Run], leading: Sequence[int], quantities: Sequence[Quantity]) -> int:
    """Points that each line may have."""
    lines = sum(len(runs) + (len(leading) if each.desired else 0) for each in quantities)
    return MOST_NUMBERS // max(lines, 1)


def of_errors(runs: Sequence[Run], spectra: Sequence[Sequence[Spectrum]]) -> plotly.Figure:
    """Figure of the errors' spectra.

    Parameters
    ----------
    runs : sequence of Run
    spectra : sequence of sequence of Spectrum
        Of each run, of each hinge.
    """
    colours, panels = run_colours([run.law for run in runs]), []
    each = int(np.clip(LINES_OF_ALL // len(runs), FEWEST_LINES_EACH_OCTAVE, MOST_LINES_EACH_OCTAVE))
    for axis, name in enumerate(ANGLES):
        traces = []
        for place, (colour, of_run) in enumerate(zip(colours, spectra, strict=True)):
            spectrum, look = of_run[axis], {"color": colour, "width": 1.3}
            x, y = highest_by_octave(spectrum.frequency_Hz, spectrum.amplitude_mrad, each)
            hover = "%{x:.4g} Hz: %{y:.3g} mrad<extra></extra>"
            traces.append(plotly.Scatter(x=_small(x), y=_small(y), mode="lines", line=look,
                                         meta=f"{place}", hovertemplate=hover))  # fmt: skip
            tops = np.array(spectrum.peaks).reshape(-1, 2).T
            traces.append(plotly.Scatter(x=tops[0], y=tops[1], mode="markers", hoverinfo="skip",
                                         marker={"color": colour, "size": 8}, meta=f"{place}"))  # fmt: skip
        panels.append(
            Panel(f"error of {name}, amplitude [mrad]", traces, {"type": "log", "exponentformat": "power"})
        )
    return stacked(panels, "frequency [Hz]", type="log")


def _line(run: Run, place: int, values: Array, most: int, colour: str, width: float) -> plotly.Scatter:
    few = thinned(values, most)
    return plotly.Scatter(
        x0=float(run.table["t_s"][0]),
        dx=run.period_s * few.rows_each,
        y=_small(few.values),
        mode="lines",
        line={"color": colour, "width": width},
        meta=f"{place}",
        hovertemplate="%{y:.4g}<extra></extra>",
    )


def _currents(runs: Sequence[Run]) -> list[Panel]:
    """Of each run a panel: a row a group, blue negative, red positive, on one scale."""
    largest_A = max(float(np.nanmax(np.abs(run.table["current_A"]))) for run in runs)
    panels = []
    for place, run in enumerate(runs):
        groups = run.table["current_A"].shape[1]
        few = strongest(run.table["current_A"], min(MOST_COLUMNS, MOST_CURRENTS // (groups * len(runs))))
        step_s, hover = run.period_s * few.rows_each, "group %{y}: %{z:.3g} A<extra></extra>"
        trace = plotly.Heatmap(z=_small(few.values.T), x0=float(run.table["t_s"][0]) + step_s / 2, dx=step_s,
                               colorscale=BLUE_TO_RED, zmin=-largest_A, zmax=largest_A, showscale=False,
                               meta=f"{place}", hovertemplate=hover)  # fmt: skip
        title = f"currents by group, up to ±{largest_A:.3g} A: {_text(run.label)}"
        panels.append(Panel(title, [trace], {"autorange": "reversed", "dtick": max(1, groups // 6)}))
    return panels


def _happened(runs: Sequence[Run], colours: Sequence[str]) -> Panel:
    """A row a run, a mark an event."""
    traces = []
    for place, (run, colour) in enumerate(zip(runs, colours, strict=True)):
        times = [each[0] for each in run.events]
        text = [_text(f"{t_s:.4g} s: {text}") for t_s, _, text in run.events]
        symbols = ["circle" if level == "INFO" else "triangle-up" for _, level, _ in run.events]
        traces.append(plotly.Scatter(x=times, y=[place + 1] * len(times), mode="markers", text=text,
                                     marker={"color": colour, "size": 9, "symbol": symbols},
                                     meta=f"{place}", hovertemplate="%{text}<extra></extra>"))  # fmt: skip
    axis = {"range": (len(runs) + 0.6, 0.4), "dtick": 1, "fixedrange": True}
    return Panel("events, by run", traces, axis, height=0.25 + 0.15 * len(runs))


def _small(values: Array) -> np.ndarray:
    """In half the bytes: seven digits are more than a plot shows."""
    return np.ascontiguousarray(values, dtype=np.float32)


def _text(text: str) -> str:
    """Text in which no tag is obeyed; quotes stay, which the library would show as they are written."""
    return escape(text, quote=False)
