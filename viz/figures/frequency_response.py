"""Figure of frequency responses: gain and phase over the frequency, measured next to linear."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from spheretwin.viz.figures.style import INK, faint_grid, legend_below, sheet, styles

Array = NDArray[np.float64]
Response = NDArray[np.complex128]
Loop = tuple[Array, Response, Response]
"""Frequencies in Hz, measured and linear response of the opened loop."""


SMALLEST = 1e-5
"""Gain below which a response is a zero that rounding fills; it is not drawn."""


def bode(by_law: Mapping[str, Loop], labels: Mapping[str, str], title: str) -> Figure:
    """Draw gains and phases; markers: measured, lines: linear.

    Parameters
    ----------
    by_law : mapping of law to Loop
    labels : mapping of law to label
    title : str
    """
    figure, ((upper,), (lower,)) = sheet(5.6, 2, title=title, sharex=True)
    looks = styles(list(by_law))
    for law, (f, *both) in by_law.items():
        style, label = looks[law], labels[law]
        measured, linear = map(_curves, both)
        for axes, line, points in zip((upper, lower), linear, measured, strict=True):
            axes.plot(f, line, linewidth=1.4, label=label if axes is upper else None, **style.line())
            axes.plot(f, points, style.marker, color=style.colour, markersize=4.5)
    for axes, level in ((upper, 0.0), (lower, -180.0)):
        axes.axhline(level, color=INK, linestyle="--", linewidth=1)
        faint_grid(axes)
    upper.set_xscale("log")
    upper.set_ylabel("gain of the opened loop, dB")
    lower.set_ylabel("phase, degrees")
    lower.set_xlabel("frequency, Hz")
    lower.xaxis.set_major_formatter("{x:g}")
    handles = [
        Line2D([], [], color=INK, linewidth=1.4, label="linear model of the sampled loop"),
        Line2D([], [], color=INK, marker="o", linestyle="", markersize=4.5, label="measured"),
    ]
    legend_below(figure, [upper], 2, handles, handlelength=3.2)
    return figure


def _curves(response: Response) -> tuple[Array, Array]:
    """Return gain (dB) and phase (degrees), NaN where the response is 0."""
    gain = np.abs(response)
    drawn = gain > SMALLEST
    gain_dB = 20 * np.log10(np.where(drawn, gain, 1.0))
    return np.where(drawn, gain_dB, np.nan), np.where(drawn, _phase_deg(response), np.nan)


def _phase_deg(response: Response) -> Array:
    """Return the phase without jumps, from −360 to 0 at the first frequency."""
    phase = np.degrees(np.unwrap(np.angle(response)))
    return np.asarray(phase - 360 * np.ceil(phase[0] / 360), np.float64)
