"""Panels that stand in more than one view: the run in a line, currents, phase plane, log."""

from __future__ import annotations

import rerun.blueprint as rrb

from spheretwin.viz.layout.paths import CURRENT_BARS, CURRENT_MAP, EVENTS, PHASE_PLANE, SUMMARY, TIMELINE
from spheretwin.viz.layout.plots import Line, Plots
from spheretwin.viz.layout.seen import Channel

PHASE_TRAIL_S = 1.0


def run_line() -> rrb.TextDocumentView:
    """What the run is and how it stands."""
    return rrb.TextDocumentView(origin=f"/{SUMMARY}", name="run", titlebar=False)


def current_map(plots: Plots) -> rrb.TimeSeriesView:
    """Currents as colours: a row for each group, time along it."""
    limit, groups = plots.view.current_limit_A, plots.view.groups
    title = f"currents of groups 0 (lowest) to {groups - 1}: blue -{limit:g} A, red +{limit:g} A"
    return plots.fixed(title, Line(CURRENT_MAP, CURRENT_MAP), low=-0.7, high=groups - 0.3)


def current_bars(plots: Plots) -> rrb.Spatial2DView:
    """Currents of this moment, one bar a group, between the limits."""
    return rrb.Spatial2DView(
        origin=f"/{CURRENT_BARS}",
        name="currents at the cursor, by group, between the limits",
        visual_bounds=rrb.VisualBounds2D(x_range=[-0.1, 2.1], y_range=[-0.6, 0.7]),
    )


def phase_plane(plots: Plots) -> rrb.Spatial2DView:
    """Rate of the error over what of the sliding variable is the error's, with its last second."""
    boundary = rrb.TimeRangeBoundary
    trail = rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=boundary.cursor_relative(seconds=-PHASE_TRAIL_S),
        end=boundary.cursor_relative(),
    )
    bounds = None
    if plots.seen:
        size = plots.seen.limit(Channel("sliding_s"), least=0.1) / 2
        bounds = rrb.VisualBounds2D(x_range=[-size, size], y_range=[-size, size])
    return rrb.Spatial2DView(
        origin=f"/{PHASE_PLANE}",
        name="phase plane: ė up, s - ė right; line s = 0",
        visual_bounds=bounds,
        time_ranges=trail,
    )


def log() -> rrb.TextLogView:
    """What is worth a line."""
    columns = rrb.TextLogColumns(text_log_columns=["loglevel", "body"])  # all have one path
    return rrb.TextLogView(origin=f"/{EVENTS}", name="events", columns=columns)
