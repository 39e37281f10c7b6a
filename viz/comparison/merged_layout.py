"""Layout of several runs in one recording: a plot for each quantity, tabs for all values and differences."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import rerun.blueprint as rrb

from spheretwin.viz.comparison.ghosts import ROTOR
from spheretwin.viz.layout.layout import blueprint, eye
from spheretwin.viz.layout.plots import time_axis, time_range
from spheretwin.viz.layout.view import EVENTS, application_of
from spheretwin.viz.scene.entities import TRAIL_S
from spheretwin.viz.scene.meshes import WORLD

COMPARE, MARKS, END, TIP, DIFFERENCE = "compare", "marks", "end", "tip", "difference"
"""Parts of the paths of entities, after the name of a run."""

RUNS, LEGEND = "runs", "legend"
"""Entities of all runs: their description, and their colours with labels."""

REFERENCE = "setpoint"
"""Before the name of a run: a viewer draws lines in the order of their paths, these above all others."""

LARGE, BESIDE_TEXTS = "whole", "more"
"""Groups of the error as one angle, and of plots in tabs with the texts."""

ERRORS = "error"
"""Group of the errors of the hinges, with their differences to those of the first run."""

SWITCHED = (LARGE, ERRORS)
"""Groups with tabs, which are higher: one for the settled runs, others for all values and for differences."""


AxisRange = tuple[float, float]


class QuantityPlot(NamedTuple):
    """Plot of one quantity of all runs."""

    name: str
    heading: str
    group: str
    desired: bool
    """True if the reference is drawn with it."""
    limits: AxisRange
    whole: AxisRange
    """Limits that contain all values."""

    @property
    def title(self) -> str:
        """Heading, and that values are outside of the limits."""
        return self.heading if self.whole == self.limits else f"{self.heading}, cut"


class ComparisonView(NamedTuple):
    """Properties of the runs on which the layout depends."""

    runs: tuple[str, ...]
    """Names."""
    leaders: tuple[str, ...]
    """Names of the runs that show the reference."""
    plots: tuple[QuantityPlot, ...]
    differences: tuple[QuantityPlot, ...]
    """Plots of the errors minus those of the first run."""
    duration_s: float
    states: tuple[str, ...]
    """Names of the runs with changes of state."""
    logs: tuple[str, ...]
    """Names of the runs with events."""
    failed: tuple[str, ...]
    """Names of the runs that are not complete."""
    size: float
    """Size of the first run's actuator, which is drawn completely."""


def application(view: ComparisonView) -> str:
    """Return the application id of recordings with one layout: a viewer keeps one layout for each."""
    return application_of("spheretwin-runs", repr(view))


def layout(view: ComparisonView) -> rrb.Blueprint:
    """Blueprint of a recording of several runs."""
    groups = dict.fromkeys(plot.group for plot in view.plots if plot.group != BESIDE_TEXTS)
    rows = [_row(view, group) for group in groups]
    texts = rrb.Tabs(
        rrb.TextDocumentView(origin=f"/{RUNS}", name="runs"),
        rrb.TextLogView(origin="/", contents=[f"/{run}/{EVENTS}" for run in view.logs], name="events"),
        *([_states(view)] if view.states else []),
        *(_plot(view, plot, plot.limits) for plot in _plots(view, BESIDE_TEXTS)),
    )
    return blueprint(
        rrb.Horizontal(
            rrb.Vertical(_bodies(view), _legend(view), texts, row_shares=[5, 0.5 + 0.6 * len(view.runs), 3]),
            rrb.Vertical(*rows, row_shares=[4 if group in SWITCHED else 3 for group in groups]),
            column_shares=[2, 3],
            name="compare",
        )
    )


def _row(view: ComparisonView, group: str) -> rrb.Container:
    """Return the plots of a group; in tabs with errors that are cut all values, and differences."""
    plots = _plots(view, group)
    tabs = [rrb.Horizontal(*(_plot(view, plot, plot.limits) for plot in plots), name="settled")]
    if group in SWITCHED and any(plot.whole != plot.limits for plot in plots):
        tabs.append(rrb.Horizontal(*(_plot(view, plot, plot.whole) for plot in plots), name="all values"))
    if group == ERRORS and view.differences:
        tabs.append(rrb.Horizontal(*map(partial(_difference, view), view.differences), name="minus run 1"))
    return rrb.Tabs(*tabs, active_tab=0) if len(tabs) > 1 else tabs[0]


def _plots(view: ComparisonView, group: str) -> list[QuantityPlot]:
    return [plot for plot in view.plots if plot.group == group]


def _plot(view: ComparisonView, plot: QuantityPlot, limits: AxisRange) -> rrb.TimeSeriesView:
    contents = [
        *(f"/{REFERENCE}/{run}/{plot.name}" for run in view.leaders if plot.desired),
        *(f"/{run}/{COMPARE}/{plot.name}" for run in view.runs),
        *(f"/{run}/{MARKS}/{plot.name}" for run in view.runs),
        *(f"/{run}/{END}/{plot.name}" for run in view.failed if limits == plot.limits),
    ]
    return _time_plot(view, plot.title if limits == plot.limits else plot.heading, contents, limits)


def _difference(view: ComparisonView, plot: QuantityPlot) -> rrb.TimeSeriesView:
    contents = [f"/{run}/{DIFFERENCE}/{plot.name}" for run in view.runs[1:]]
    return _time_plot(view, plot.title, contents, plot.limits)


def _time_plot(
    view: ComparisonView, title: str, contents: Sequence[str], limits: AxisRange
) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin="/",
        contents=contents,
        name=title,
        axis_x=time_axis(view.duration_s),
        axis_y=rrb.ScalarAxis(range=limits),
        plot_legend=rrb.PlotLegend(visible=False),
        interaction=rrb.PlotInteraction(tooltip_mode="All"),
    )


def _bodies(view: ComparisonView) -> rrb.Spatial3DView:
    first, *ghosts = view.runs
    tips = [f"/{run}/{TIP}" for run in view.runs] + [f"/{REFERENCE}/{run}/{TIP}" for run in view.leaders]
    bodies = [f"/{first}/{WORLD}/**", *(f"/{run}/{ROTOR}/**" for run in ghosts)]
    return rrb.Spatial3DView(
        origin="/",
        contents=[*bodies, *(f"{tip}/**" for tip in tips)],
        name="run 1; the others as ghosts",
        line_grid=False,
        eye_controls=eye(view.size),
        overrides={f"{tip}/path": time_range(TRAIL_S) for tip in tips},
    )


def _legend(view: ComparisonView) -> rrb.Spatial2DView:
    """View of the colours and labels of the runs: a legend within a plot would cover lines."""
    bounds = rrb.VisualBounds2D(x_range=[-0.1, 1.1], y_range=[-0.5, len(view.runs) - 0.1])
    return rrb.Spatial2DView(origin=f"/{LEGEND}", name="runs", visual_bounds=bounds)


def _states(view: ComparisonView) -> rrb.StateTimelineView:
    contents = [f"/{run}/**" for run in view.states]
    return rrb.StateTimelineView(
        origin="/", contents=contents, name="states", time_view=time_axis(view.duration_s)
    )
