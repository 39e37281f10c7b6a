"""Figure of hinge friction: ramps of torque, coasting and stopping, next to ideal friction."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spheretwin.viz.figures.style import (
    FAINT,
    INK,
    SERIES,
    WIDTH_in,
    common_legend,
    faint_grid,
)

Array = NDArray[np.float64]

SLOWEST_rad_s, FASTEST_rad_s, FASTEST_AT_STOP_rad_s = 1e-4, 2.0, 0.3  # of the logarithmic axes
UP, BACK = 0.06, 0.8  # shares of the largest rate at which arrows show the direction of the ramp
AROUND_STOP_ms = 60.0


class Ramped(NamedTuple):
    """A ramp of torque up and back, a row a step, and the creep under a constant torque below the level."""

    torque_Nm: Array  # (n,)
    rates_rad_s: Mapping[str, Array]  # (n,) by way
    ideal_rad_s: Array  # (n,)
    level_Nm: float
    push_Nm: float
    creep_rad_s: Mapping[str, float]


class Resting(NamedTuple):
    """Coasting to rest; a row a step."""

    t_s: Array  # (m,)
    rates_rad_s: Mapping[str, Array]  # (m,) by way
    ideal_rad_s: Array  # (m,)
    ideal_stop_s: float


def hinge_friction(bearings: Mapping[str, tuple[Ramped, Resting]], title: str) -> Figure:
    """Draw a column for each bearing: rate against a slow torque, coasting against ideal friction, stopping.

    Each way has one colour; ideal friction is dashed.

    Parameters
    ----------
    bearings : mapping of bearing to Ramped and Resting
    title : str
    """
    figure = Figure(figsize=(WIDTH_in, 8.6), layout="constrained")
    rows = figure.subplots(3, len(bearings), squeeze=False, sharey="row")
    for (above, middle, below), (name, (ramped, resting)) in zip(rows.T, bearings.items(), strict=True):
        _ramp(above, ramped)
        _coast(middle, resting)
        _stop(below, resting)
        above.set_title(f"{name}\nslow torque, up and back", fontsize="medium")
        middle.set_title(f"coasting from {resting.ideal_rad_s[0]:g} rad/s", fontsize="medium")
        below.set_title("coming to rest", fontsize="medium")
    for axes, quantity in zip(
        rows[:, 0], ("rate, rad/s", "rate less ideal, mrad/s", "rate, rad/s"), strict=True
    ):
        axes.set_ylabel(quantity)
    common_legend(figure, rows[0], ncols=3)
    figure.suptitle(title, fontsize="medium")
    return figure


def _ramp(axes: Axes, ramped: Ramped) -> None:
    torque_mNm = 1e3 * ramped.torque_Nm
    for colour, way, rate in _ways(ramped.rates_rad_s):
        axes.plot(torque_mNm, _clipped(rate), color=colour, label=way)
        axes.plot(1e3 * ramped.push_Nm, ramped.creep_rad_s[way], "o", color=colour, markersize=5)
    _ideal(axes, torque_mNm, _clipped(ramped.ideal_rad_s))
    axes.axvline(1e3 * ramped.level_Nm, color=FAINT, linewidth=1.2, label="Coulomb level")
    axes.plot([], [], "o", color=INK, markersize=5, label="settled at half the level")
    ideal, fastest = ramped.ideal_rad_s, int(np.argmax(ramped.ideal_rad_s))
    _arrow(axes, torque_mNm, ideal, int(np.argmax(ideal >= UP * ideal[fastest])))
    _arrow(axes, torque_mNm, ideal, fastest + int(np.argmax(ideal[fastest:] <= BACK * ideal[fastest])))
    _slow_rates(axes, FASTEST_rad_s)
    _label_axes(axes, "torque, mN·m")


def _coast(axes: Axes, resting: Resting) -> None:
    for colour, _, rate in _ways(resting.rates_rad_s):
        axes.plot(resting.t_s, 1e3 * (rate - resting.ideal_rad_s), color=colour)
    axes.axhline(0, color=INK, linewidth=1.1, linestyle=(0, (4, 4)))
    axes.axvline(resting.ideal_stop_s, color=FAINT, linewidth=0.8, linestyle=":")
    _label_axes(axes, "time, s")


def _stop(axes: Axes, resting: Resting) -> None:
    after_ms = 1e3 * (resting.t_s - resting.ideal_stop_s)
    shown = np.abs(after_ms) <= AROUND_STOP_ms
    for colour, _, rate in _ways(resting.rates_rad_s):
        axes.plot(after_ms[shown], _clipped(rate[shown]), color=colour)
    _ideal(axes, after_ms[shown], _clipped(resting.ideal_rad_s[shown]))
    _slow_rates(axes, FASTEST_AT_STOP_rad_s)
    _label_axes(axes, "time after the ideal stop, ms")


def _slow_rates(axes: Axes, fastest_rad_s: float) -> None:
    axes.set_yscale("log")
    axes.set_ylim(SLOWEST_rad_s, fastest_rad_s)


def _arrow(axes: Axes, x: Array, y: Array, row: int) -> None:
    """An arrow's head on a curve, towards the rows that follow."""
    ahead = row + max(1, len(x) // 100)
    axes.annotate(
        "",
        xy=(x[ahead], y[ahead]),
        xytext=(x[row], y[row]),
        arrowprops={"arrowstyle": "-|>", "color": INK, "linewidth": 0, "mutation_scale": 14},
    )


def _ways(rates_rad_s: Mapping[str, Array]) -> Iterator[tuple[str, str, Array]]:
    for colour, (way, rate) in zip(SERIES, rates_rad_s.items(), strict=False):
        yield colour, way, rate


def _ideal(axes: Axes, x: Array, rate_rad_s: Array) -> None:
    axes.plot(x, rate_rad_s, color=INK, linewidth=1.1, linestyle=(0, (4, 4)), label="ideal friction")


def _clipped(rate_rad_s: Array) -> Array:
    """Return rates for a logarithmic axis: smaller ones lie on its edge, and zero below it."""
    return np.maximum(rate_rad_s, 0.1 * SLOWEST_rad_s)


def _label_axes(axes: Axes, x: str) -> None:
    axes.set_xlabel(x)
    faint_grid(axes)
