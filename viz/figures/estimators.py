"""Figure of the rates' estimators: what noise leaves, and what lag costs, against bandwidth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spheretwin.viz.figures.plots import FAINT, SERIES, WIDTH_in, save

__all__ = ["Curve", "estimators", "save"]

Array = NDArray[np.float64]

LEAST_LAG_s = 1e-5  # less is drawn as this much: beside a period of 1 ms it is none


class Curve(NamedTuple):
    """One estimator over the bandwidths."""

    rms_error_rad_s: Array  # (b,)
    lag_s: Array  # (b,) below zero where it is ahead
    lag_deviation_s: Array  # (b,)
    derived_rms_error_rad_s: Array  # (b,)
    derived_lag_s: Array  # (b,)
    default_rad_s: float


def estimators(bandwidths_rad_s: Array, curves: Mapping[str, Curve], title: str) -> Figure:
    """RMS error of the rate above, lag below: a colour an estimator, dots measured, lines derived.

    Each estimator's default is a dashed line of its colour. A lag that the noise does not let be told from
    none is drawn hollow, at the largest that it may be.

    Parameters
    ----------
    bandwidths_rad_s : (b,) array, rad/s
    curves : mapping of estimator to Curve
    title : str
    """
    figure = Figure(figsize=(WIDTH_in, 6.4), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    for colour, marker, (name, curve) in zip(SERIES, "osD^v", curves.items(), strict=False):
        dots = {"linestyle": "", "marker": marker, "color": colour, "markersize": 5}
        above.plot(bandwidths_rad_s, curve.rms_error_rad_s, label=name, **dots)
        above.plot(bandwidths_rad_s, curve.derived_rms_error_rad_s, color=colour, linewidth=1)
        told = curve.lag_s > 2 * curve.lag_deviation_s
        lag_s = np.where(told, curve.lag_s, np.maximum(curve.lag_s, 0) + 2 * curve.lag_deviation_s)
        lag_ms = 1e3 * np.maximum(lag_s, LEAST_LAG_s)
        below.plot(bandwidths_rad_s[told], lag_ms[told], label=name, **dots)
        if not np.all(told):
            below.plot(bandwidths_rad_s[~told], lag_ms[~told], markerfacecolor="none",
                       label=f"{name}: at most", **dots)  # fmt: skip
        if np.any(curve.derived_lag_s > 0):
            below.plot(bandwidths_rad_s, 1e3 * curve.derived_lag_s, color=colour, linewidth=1)
    for axes, quantity in ((above, "RMS error of the rate, rad/s"), (below, "lag of the rate, ms")):
        for colour, curve in zip(SERIES, curves.values(), strict=False):
            axes.axvline(curve.default_rad_s, color=colour, linestyle="--", linewidth=1.2)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_ylabel(quantity)
        axes.grid(visible=True, which="both", color=FAINT, alpha=0.35, linewidth=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
    above.set_title(f"{title}\ndots measured, lines derived, dashed the defaults", fontsize="medium")
    below.set_xlabel("bandwidth, rad/s")
    return figure
