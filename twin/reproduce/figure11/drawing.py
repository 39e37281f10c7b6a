"""Figures of figure 11's page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from spheretwin.twin.reproduce.figure11.laws import BY_LAW, Compared
from spheretwin.viz.figures.drawing import Drawing

Array = NDArray[np.float64]

WINDOW_s = 0.02
"""Of the figure of the errors: each point is the largest within one."""

BANDWIDTHS_rad_s = np.geomspace(25, 1600, 13)


def errors(windows: Mapping[str, Sequence[Array]]) -> Drawing:
    """Measured |error| of α and β over time.

    Parameters
    ----------
    windows : mapping of law to (windows, 2) arrays, rad
        One for each seed.
    """
    from spheretwin.viz.figures import errors as figures

    courses = {
        BY_LAW[law].label: figures.Course(
            law, _stacked(of_seeds), BY_LAW[law].paper_deg or 0.0, BY_LAW[law].paper_axes
        )
        for law, of_seeds in windows.items()
    }
    figure = figures.courses(courses, WINDOW_s, ("α", "β"), "Tilt on the prototype: measured error")
    caption = (
        f"Largest measured |error| within each {1e3 * WINDOW_s:g} ms: median over the seeds, and their range"
        " as a band. Dotted: the largest error in the paper's figure."
    )
    return Drawing("figure11_errors.png", caption, figure)


def changes(drawn: Sequence[tuple[Compared, list[tuple[str, Array, Array]]]]) -> Drawing:
    """Largest error of α under every single change; errors in rad, one for each seed."""
    from spheretwin.viz.figures import errors as figures

    groups = [
        figures.Group(
            compared.law,
            compared.label,
            [figures.Line(label, np.degrees(measured), np.degrees(true)) for label, measured, true in lines],
            compared.paper_deg,
        )
        for compared, lines in drawn
    ]
    figure = figures.lines(groups, "largest |error| of α, degrees", "One change at a time")
    caption = "Largest |error| of α: median over the seeds, and range; filled as measured, hollow as it is."
    return Drawing("figure11_changes.png", caption, figure)


def estimators() -> Drawing:
    """The estimators over their bandwidths."""
    from spheretwin.control.estimation.comparison import compare
    from spheretwin.viz.figures import estimators as figures

    curves = {kind: figures.Curve(*compared) for kind, compared in compare(BANDWIDTHS_rad_s.tolist()).items()}
    figure = figures.estimators(BANDWIDTHS_rad_s, curves, "Rates of the paper's sinusoid from noisy angles")
    caption = "RMS error and lag of the estimated rate against the estimator's bandwidth, 0.02° rms of noise."
    return Drawing("figure11_estimators.png", caption, figure)


def _stacked(of_seeds: Sequence[Array]) -> Array:
    """(seeds, windows, 2) in degrees; after the end of a run that ended early there are no numbers."""
    longest = max(len(each) for each in of_seeds)
    stacked = np.full((len(of_seeds), longest, 2), np.nan)
    for row, each in zip(stacked, of_seeds, strict=True):
        row[: len(each)] = np.degrees(each)
    return stacked
