"""Overview of one run for a notebook: angles, tracking error and largest current over time."""

from __future__ import annotations

import base64
import io

import numpy as np
from matplotlib.figure import Figure

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.figures.style import (
    AXES,
    DASHES,
    DPI,
    INK,
    WIDTH_in,
    draw_line,
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
    t_s = table["t_s"]
    for i, (name, colour) in enumerate(zip(ANGLES, AXES, strict=True)):
        look = {"color": colour, "linestyle": DASHES[i], "linewidth": 1.1}
        for panel, values in (
            (angles, np.degrees(table["q_rad"][:, i])),
            (errors, 1e3 * table["error_rad"][:, i]),
        ):
            draw_line(panel, t_s, values, label=name, **look)
    for i in range(len(ANGLES)):
        look = {"color": INK, "linewidth": 0.7, "linestyle": (0, (4, 3))}
        label = None if i else "references"
        draw_line(angles, t_s, np.degrees(table["q_ref_rad"][:, i]), label=label, **look)
    largest = np.abs(table["current_A"]).max(axis=1)
    draw_line(currents, t_s, largest, color=INK, linewidth=1.1)
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
