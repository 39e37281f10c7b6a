"""Overview of one run for a notebook: angles, tracking error and largest current over time."""

from __future__ import annotations

import base64
import io

import numpy as np
from matplotlib.figure import Figure

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.decimation import decimate_extremes
from spheretwin.viz.figures.style import (
    AXES,
    DPI,
    INK,
    MOST_POINTS,
    WIDTH_in,
    plain,
)


def overview(table: Table, title: str) -> Figure:
    """Draw a run: hinge angles with their references, tracking errors, largest current of all groups.

    Parameters
    ----------
    table : Table
        Telemetry with at least one row.
    title : str
    """
    figure = Figure(figsize=(WIDTH_in, 6.0), layout="constrained")
    angles, errors, currents = figure.subplots(3, 1, sharex=True)
    for i, (name, colour) in enumerate(zip(ANGLES, AXES, strict=True)):
        angle = _decimated(table, np.degrees(table["q_rad"][:, i]))
        error = _decimated(table, 1e3 * table["error_rad"][:, i])
        angles.plot(*angle, color=colour, label=name, linewidth=1.1)
        errors.plot(*error, color=colour, linewidth=1.1)
    for i in range(len(ANGLES)):
        reference = _decimated(table, np.degrees(table["q_ref_rad"][:, i]))
        label = None if i else "references"
        angles.plot(*reference, color=INK, label=label, linewidth=0.7, linestyle=(0, (4, 3)))
    largest = np.abs(table["current_A"]).max(axis=1)
    currents.plot(*_decimated(table, largest), color=INK, linewidth=1.1)
    for panel, heading in ((angles, "angle, °"), (errors, "error, mrad"), (currents, "largest current, A")):
        plain(panel, heading)
    figure.suptitle(title, fontsize="medium")
    lines, labels = angles.get_legend_handles_labels()  # references last
    figure.legend(lines, labels, loc="outside lower left", ncols=4, frameon=False, fontsize="small")
    currents.set_xlabel("time, s")
    return figure


def as_html(figure: Figure) -> str:
    """Return an image element that holds the figure as PNG."""
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=DPI / 2, metadata={"Software": None})
    data = base64.b64encode(content.getvalue()).decode()
    return f'<img alt="plots of the run" src="data:image/png;base64,{data}">'


def _decimated(table: Table, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    few = decimate_extremes(values, MOST_POINTS)
    period_s = float(table["t_s"][1] - table["t_s"][0]) if len(table) > 1 else 0.0
    t_s = float(table["t_s"][0]) + period_s * few.stride * np.arange(len(few.values))
    return t_s, few.values
