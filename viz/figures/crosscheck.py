"""Figures of the cross-check: values over their bounds, spreads, differences, orders.

Every series is named, every axis has its unit, and a bound is a dashed line with its value.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.viz.figures.style import (
    AXES,
    BROKEN,
    INK,
    SERIES,
    faint_grid,
    legend_below,
    name_rows,
    sheet,
)

LEAST_SHARE = 1e-14  # of a bound: less is drawn as this much
NOTHING = 1e-18  # what a difference of exactly zero is drawn as, on a logarithmic axis


def margins(values: Mapping[str, float], title: str) -> Figure:
    """Draw each figure as a share of its bound: a dot for each figure, the bound as a line.

    Parameters
    ----------
    values : mapping of str to float
        Value over bound.
    title : str
    """
    figure, ((axes,),) = sheet(0.8 + 0.26 * len(values), title=title)
    rows = np.arange(len(values))
    shares = np.clip(list(values.values()), LEAST_SHARE, 1 / LEAST_SHARE)
    for within, colour, label in (
        (True, SERIES[0], "within the bound"),
        (False, BROKEN, "exceeds the bound"),
    ):
        chosen = (shares <= 1) == within
        if np.any(chosen):
            axes.plot(shares[chosen], rows[chosen], "o", color=colour, markersize=6, label=label)
            axes.hlines(rows[chosen], LEAST_SHARE, shares[chosen], color=colour, linewidth=1, alpha=0.5)
    axes.axvline(1.0, color=INK, linestyle="--", linewidth=1.2, label="bound")
    name_rows(axes, list(values), "value over bound")
    axes.set_xlim(LEAST_SHARE, 10 * max(1.0, *shares))
    legend_below(figure, [axes], 3)
    return figure


def spreads(
    differences: Mapping[str, Mapping[str, Array]], bounds: Mapping[str, float], title: str
) -> Figure:
    """Spread of relative differences: a row a quantity, a bar a source, a tick for the bound.

    Parameters
    ----------
    differences : mapping of source to mapping of quantity to (n,) array
        Relative differences.
    bounds : mapping of quantity to float
    title : str
    """
    quantities = list(bounds)
    figure, ((axes,),) = sheet(1.3 + 0.62 * len(quantities), title=title)
    offsets = np.linspace(-0.16, 0.16, len(differences)) if len(differences) > 1 else np.zeros(1)
    for colour, offset, (source, by_quantity) in zip(SERIES, offsets, differences.items(), strict=False):
        for row, quantity in enumerate(quantities):
            values = np.maximum(by_quantity[quantity], NOTHING)
            low, middle, high = np.quantile(values, [0.01, 0.5, 0.99])
            y, named = row + offset, f"{source}: 1 to 99 %" if row == 0 else None
            axes.plot([low, high], [y, y], color=colour, linewidth=7, alpha=0.45, solid_capstyle="butt",
                      label=named)  # fmt: skip
            axes.plot(middle, y, "|", color=colour, markersize=11, markeredgewidth=2,
                      label="median" if row == 0 else None)  # fmt: skip
            axes.plot(values.max(), y, "o", color=colour, markersize=5, label="worst" if row == 0 else None)
    for row, bound in enumerate(bounds.values()):
        axes.plot([bound, bound], [row - 0.36, row + 0.36], color=INK, linewidth=1.6, linestyle="--",
                  label="bound" if row == 0 else None)  # fmt: skip
    name_rows(axes, quantities, "relative difference")
    legend_below(figure, [axes])
    return figure


def motion(t_s: Array, q_rad: Array, difference_rad: Array, bound_rad: float, title: str) -> Figure:
    """Hinge angles over time, and below them how far two ways of computing them are apart.

    Parameters
    ----------
    t_s : (n,) array, s
    q_rad, difference_rad : (n, 3) array, rad
    bound_rad : float, rad
    title : str
    """
    figure, grid = sheet(6.0, 3, title=title, sharex=True, height_ratios=[2, 1, 2])
    tilt, spin, apart = grid[:, 0]
    for axis, (colour, name) in enumerate(zip(AXES, ANGLES, strict=True)):
        where = spin if axis == 2 else tilt
        where.plot(t_s, q_rad[:, axis], color=colour, label=name)
        apart.plot(t_s, _positive(difference_rad[:, axis]), color=colour, linewidth=1, label=name)
    apart.set_yscale("log")
    apart.axhline(bound_rad, color=INK, linestyle="--", linewidth=1.2, label=f"bound {bound_rad:.1e} rad")
    apart.set_xlabel("time, s")
    for axes, quantity in ((tilt, "tilt, rad"), (spin, "spin, rad"), (apart, "|difference|, rad")):
        _finish(axes, quantity)
    return figure


def convergence(slopes: Mapping[str, tuple[Array, Array, float]], title: str) -> Figure:
    """Error against step, both logarithmic, with the fitted power of the step as a dashed line.

    Parameters
    ----------
    slopes : mapping of method to its steps in s, errors, and order
    title : str
    """
    figure, ((axes,),) = sheet(4.6, title=title)
    for colour, marker, size, (name, (steps_s, errors, order)) in zip(
        SERIES, "osDx^", (8, 9, 5, 6, 6), slopes.items(), strict=False
    ):
        factor = np.exp(np.mean(np.log(errors / steps_s**order)))
        ends = np.array([steps_s.min(), steps_s.max()])
        hollow = "none" if marker in "os" else colour
        axes.plot(steps_s * 1e3, errors, marker, color=colour, markersize=size,
                  markerfacecolor=hollow, label=f"{name}: order {order:.2f}")  # fmt: skip
        axes.plot(ends * 1e3, factor * ends**order, "--", color=colour, linewidth=1)
    axes.set(xscale="log", yscale="log")
    steps_ms = 1e3 * np.unique(np.concatenate([steps_s for steps_s, *_ in slopes.values()]))
    axes.set_xticks(steps_ms, [f"{step:g}" for step in steps_ms])
    axes.minorticks_off()
    axes.set_xlabel("step, ms")
    _finish(axes, "largest error of a hinge angle, rad")
    return figure


def _positive(values: Array) -> Array:
    """Sizes for a logarithmic axis, with gaps where they are zero."""
    return np.where(values == 0, np.nan, np.abs(values))


def _finish(axes: Axes, y: str) -> None:
    """Set label, legend and a faint grid; remove the box."""
    axes.set_ylabel(y)
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
    faint_grid(axes)
