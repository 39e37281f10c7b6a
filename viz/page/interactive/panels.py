"""Panels one below the other on one axis: a zoom or a cursor in one of them is in all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import plotly.graph_objects as plotly

FAINT, INK, ASKED = "#e3e6ea", "#30343a", "#9aa1ab"

HEIGHT_px, GAP_px, MARGIN_px = 150, 26, 46


class Panel(NamedTuple):
    """One of them."""

    title: str
    """With its unit."""
    traces: Sequence[Any]
    axis: dict[str, Any]
    """What its vertical axis has beside the looks of all."""
    height: float = 1.0
    """Of that of an ordinary one."""


def stacked(panels: Sequence[Panel], x: str, **axis: Any) -> plotly.Figure:
    """Figure of panels.

    Parameters
    ----------
    panels : sequence of Panel
    x : str
        What the common axis is, with its unit.
    **axis
        What it has beside the looks of all.
    """
    inner_px = sum(panel.height * HEIGHT_px + GAP_px for panel in panels)
    figure, top = plotly.Figure(), 1.0
    for place, panel in enumerate(panels, start=1):
        number = "" if place == 1 else f"{place}"
        bottom = top - panel.height * HEIGHT_px / inner_px
        looks = {"gridcolor": FAINT, "zerolinecolor": FAINT, "linecolor": INK, "tickfont_size": 11}
        figure.layout[f"yaxis{number}"] = {"domain": (max(bottom, 0.0), top), **looks, **panel.axis}
        for trace in panel.traces:
            trace.update(xaxis="x", yaxis=f"y{number}")
            figure.add_trace(trace)
        figure.add_annotation(text=f"<b>{panel.title}</b>", xref="paper", yref="paper", x=0, y=top,
                              xanchor="left", yanchor="bottom", showarrow=False, font_size=12)  # fmt: skip
        top = bottom - GAP_px / inner_px
    spikes = {"showspikes": True, "spikemode": "across", "spikesnap": "cursor", "spikethickness": 1}
    last = "" if len(panels) == 1 else f"{len(panels)}"
    figure.update_layout(
        template="none",
        height=inner_px + 2 * MARGIN_px,
        margin={"l": 64, "r": 16, "t": MARGIN_px, "b": MARGIN_px},
        font={"family": "system-ui, sans-serif", "color": INK},
        showlegend=False,
        hovermode="x",
        hoversubplots="axis",
        hoverlabel={"font_size": 11, "namelength": 0},
        xaxis={"title": {"text": x}, "anchor": f"y{last}", "gridcolor": FAINT, **spikes, **axis,
               "spikecolor": INK, "spikedash": "dot", "linecolor": INK, "zeroline": False},
    )  # fmt: skip
    return figure
