"""Figures of errors over a condition and of frequency responses: a panel a hinge, a line a law."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array
from spheretwin.viz.figures.style import (
    FAINT,
    INK,
    SERIES,
    LawStyle,
    WIDTH_in,
    draw_hollow,
    faint_grid,
    law_keys,
    legend_below,
    name_axes,
    name_rows,
    on_errors,
    sheet,
    styles,
)

ByLaw = Mapping[str, Array]

MARGIN = 1.25
SHIFT = 0.035
"""Shift between the laws, as a share of the steps of x: their ranges do not overlap."""


class ErrorsByCondition(NamedTuple):
    """Largest errors of one law over the condition."""

    law: str
    values: Array  # (n,)
    error_rad: Array  # (3, n, hinges) lowest, median and highest over the seeds
    whole: NDArray[np.bool_]  # (n,) True if every run was completed
    paper_rad: Mapping[float, Sequence[float]]  # printed, by the value of the condition


def by_condition(
    by_label: Mapping[str, ErrorsByCondition], hinges: Sequence[str], x: str, quantity: str, title: str
) -> Figure:
    """Draw the errors; hollow if a run was not completed, bars for the numbers printed in the paper.

    Parameters
    ----------
    by_label : mapping of label to ErrorsByCondition
    hinges : sequence of str
    x, quantity, title : str
    """
    figure, (panels,) = sheet(4.6, 1, len(hinges), title, 1.2 * WIDTH_in, sharey=True)
    looks = styles([series.law for series in by_label.values()])
    for hinge, (panel, name) in enumerate(zip(panels, hinges, strict=True)):
        for place, (label, series) in enumerate(by_label.items()):
            shift = SHIFT * (place - (len(by_label) - 1) / 2)
            _series(panel, label, series, looks[series.law], hinge, shift)
        name_axes(panel, x=x, title=name)
        panel.set_xticks(next(iter(by_label.values())).values)
    every = [np.ravel(series.error_rad) for series in by_label.values()]
    every += [np.ravel(list(series.paper_rad.values())) for series in by_label.values()]
    errors = 1e3 * np.concatenate(every)
    errors = errors[np.isfinite(errors)]
    on_errors(panels, errors.min() / MARGIN, errors.max() * MARGIN)
    panels[0].set_ylabel(f"{quantity}, mrad")
    _legend(figure, panels[0], by_label)
    return figure


def _series(
    panel: Axes, label: str, series: ErrorsByCondition, style: LawStyle, hinge: int, shift: float
) -> None:
    step = np.min(np.diff(series.values)) if len(series.values) > 1 else 1.0
    x = series.values + shift * step
    low, middle, high = 1e3 * series.error_rad[:, :, hinge]
    panel.plot(x, middle, label=label, linewidth=1.5, **style.line())
    panel.errorbar(x, middle, [middle - low, high - middle], fmt="none", ecolor=style.colour, capsize=2.5,
                   elinewidth=1)  # fmt: skip
    draw_hollow(panel, x, middle, series.whole, style)
    for value, printed in series.paper_rad.items():
        at = value + shift * step
        ours = middle[np.isclose(series.values, value)]
        paper = 1e3 * printed[hinge]
        panel.plot([at, at], [paper, *ours], color=style.colour, linewidth=0.9, linestyle=":")
        panel.plot(at, paper, "_", color=INK, markersize=17, markeredgewidth=4.2)
        panel.plot(at, paper, "_", color=style.colour, markersize=15, markeredgewidth=2.4)
        panel.plot(at, paper, style.marker, color="white", markersize=4.5, markeredgecolor=INK)


def _legend(figure: Figure, panel: Axes, by_label: Mapping[str, ErrorsByCondition]) -> None:
    handles = law_keys(panel, {series.law: label for label, series in by_label.items()})
    if any(series.paper_rad for series in by_label.values()):
        handles += panel.plot([], [], "_", color=INK, markersize=15, markeredgewidth=3, label="printed")
    if not all(series.whole.all() for series in by_label.values()):
        hollow: dict[str, Any] = {"color": INK, "markerfacecolor": "white", "linestyle": "", "marker": "o"}
        handles += panel.plot([], [], label="ended early", markersize=6, **hollow)
    legend_below(figure, [], 6, handles, handlelength=3.2)


WIDE = 9.0
"""Ratio of largest to smallest step from which on a scale is logarithmic."""


def margins(
    panels: Mapping[str, ByLaw],
    labels: Mapping[str, str],
    bound_rad: float,
    quantity: str,
    title: str,
) -> Figure:
    """Draw them on one scale of errors.

    Parameters
    ----------
    panels : mapping of condition to mapping of law to (n, 3) array
        Step, error in rad, 1 if the law holds.
    labels : mapping of law to label
    bound_rad : float, rad
        Bound below which a law holds.
    quantity, title : str
    """
    across = min(3, len(panels))
    down = -(-len(panels) // across)
    figure, grid = sheet(1.2 + 2.7 * down, down, across, title, 1.2 * WIDTH_in, len(panels), sharey=True)
    looks = styles(list(labels))
    for axes, (name, by_law) in zip(grid.flat, panels.items(), strict=False):
        for law, values in by_law.items():
            step, error_mrad, within_bound = values[:, 0], 1e3 * values[:, 1], values[:, 2] > 0
            style = looks[law]
            axes.plot(step, error_mrad, linewidth=1.4, **style.line())
            draw_hollow(axes, step, error_mrad, within_bound, style)
        axes.axhline(1e3 * bound_rad, color=INK, linestyle="--", linewidth=1)
        axes.set_yscale("log")
        steps = np.concatenate([values[:, 0] for values in by_law.values()])
        if steps.min() > 0 and steps.max() > WIDE * steps.min():
            axes.set_xscale("log")
            axes.xaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_major_formatter("{x:g}")
        axes.set_xlabel(name)
        faint_grid(axes)
    figure.supylabel(quantity, fontsize="medium")
    first = grid[0, 0]
    handles = law_keys(first, labels)
    handles += first.plot([], [], "o", color=INK, markerfacecolor="white", label="does not hold")
    legend_below(figure, [], 5, handles, handlelength=3.2)
    return figure


ROW_in = 0.5


def ratios(rows: Mapping[str, ByLaw], labels: Mapping[str, str], quantity: str, title: str) -> Figure:
    """Draw them on a logarithmic axis, the laws of a row below each other.

    Parameters
    ----------
    rows : mapping of reading to mapping of law to (n,) ratios
    labels : mapping of law to label
    quantity, title : str
    """
    figure, ((axes,),) = sheet(1.5 + ROW_in * len(rows), title=title)
    looks = styles(list(labels))
    for y, by_law in enumerate(rows.values()):
        for place, (law, values) in enumerate(by_law.items()):
            style = looks[law]
            at = y + 0.22 * (place - (len(by_law) - 1) / 2)
            axes.plot([values.min(), values.max()], [at, at], color=style.colour, linewidth=1.2)
            axes.plot(values, np.full(len(values), at), style.marker, color=style.colour, markersize=5,
                      alpha=0.8, label=labels[law] if y == 0 else None)  # fmt: skip
    axes.axvline(1.0, color=INK, linewidth=1.2, linestyle="--", label="the paper")
    name_rows(axes, list(rows), quantity)
    axes.xaxis.set_major_formatter("{x:g}")
    for y in range(1, len(rows)):
        axes.axhline(y - 0.5, color=FAINT, linewidth=0.4)
    legend_below(figure, [axes])
    return figure


LEAST_LAG_s = 1e-5  # lower bound of the axis: negligible compared with a period of 1 ms


class Curve(NamedTuple):
    """Errors and lags of one estimator over the bandwidths."""

    rms_error_rad_s: Array  # (b,)
    lag_s: Array  # (b,) below zero where it is ahead
    lag_deviation_s: Array  # (b,)
    derived_rms_error_rad_s: Array  # (b,)
    derived_lag_s: Array  # (b,)
    default_rad_s: float


def estimators(bandwidths_rad_s: Array, curves: Mapping[str, Curve], title: str) -> Figure:
    """RMS error of the rate above, lag below: a colour an estimator, dots measured, lines derived.

    Each estimator's default is a dashed line of its colour. A lag that the noise hides is drawn hollow, at
    its largest possible value.

    Parameters
    ----------
    bandwidths_rad_s : (b,) array, rad/s
    curves : mapping of estimator to Curve
    title : str
    """
    title = f"{title}\ndots measured, lines derived, dashed the defaults"
    figure, ((above,), (below,)) = sheet(6.4, 2, title=title, sharex=True)
    for colour, marker, (name, curve) in zip(SERIES, "osD^v", curves.items(), strict=False):
        dots = {"linestyle": "", "marker": marker, "color": colour, "markersize": 5}
        above.plot(bandwidths_rad_s, curve.rms_error_rad_s, label=name, **dots)
        above.plot(bandwidths_rad_s, curve.derived_rms_error_rad_s, color=colour, linewidth=1)
        distinct = curve.lag_s > 2 * curve.lag_deviation_s
        lag_s = np.where(distinct, curve.lag_s, np.maximum(curve.lag_s, 0) + 2 * curve.lag_deviation_s)
        lag_ms = 1e3 * np.maximum(lag_s, LEAST_LAG_s)
        below.plot(bandwidths_rad_s[distinct], lag_ms[distinct], label=name, **dots)
        if not np.all(distinct):
            below.plot(bandwidths_rad_s[~distinct], lag_ms[~distinct], markerfacecolor="none",
                       label=f"{name}: at most", **dots)  # fmt: skip
        if np.any(curve.derived_lag_s > 0):
            below.plot(bandwidths_rad_s, 1e3 * curve.derived_lag_s, color=colour, linewidth=1)
    for axes, quantity in ((above, "RMS error of the rate, rad/s"), (below, "lag of the rate, ms")):
        for colour, curve in zip(SERIES, curves.values(), strict=False):
            axes.axvline(curve.default_rad_s, color=colour, linestyle="--", linewidth=1.2)
        axes.set(xscale="log", yscale="log")
        axes.set_ylabel(quantity)
        faint_grid(axes, which="both")
        axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
    below.set_xlabel("bandwidth, rad/s")
    return figure


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
