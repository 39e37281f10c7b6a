"""Plots over time: their lines, ranges and titles."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from typing import Any, NamedTuple

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint import Visualizer
from rerun.blueprint.archetypes import ViewBlueprint, ViewContents
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

from spheretwin.models.telemetry.signals import ANGLES, common_signals
from spheretwin.viz.layout.extents import ROOM, CurrentRanges, Extents, PlotChannel, number
from spheretwin.viz.layout.styles import AXES_ONLY, LINE_LOOKS, MOST_MARKED
from spheretwin.viz.layout.view import (
    DERIVED,
    ENDED,
    ENVELOPE,
    LIMITS,
    MARKS,
    ONSETS,
    RUN,
    STYLES,
    TELEMETRY,
    TIMELINE,
    VALUES,
    View,
    component,
    shown_until_s,
)
from spheretwin.viz.quantities import Quantity

Range = tuple[float, float]

CUT = ", cut"
"""End of the title of a plot with values outside of its range."""

KEY = "●"
"""First marker of a key in the title of a plot."""


class PlotLine(NamedTuple):
    """Lines of a plot: those of a signal, of a derived quantity, or of an entity with its own values."""

    entity: str
    name: str
    """Field of the entity's values; its bounds have this name. Empty for an entity with its own values."""
    size: int = 1
    """Entries, each a line."""


def quantity(of: Quantity) -> PlotLine:
    """Return the lines of a derived quantity."""
    return PlotLine(DERIVED, of.name, of.size)


class Fit(NamedTuple):
    """Properties of a plot that follow from the extents of a run."""

    title: str
    band: Range | None = None
    """None for the range that is known before the run."""


class _Plot(NamedTuple):
    view: rrb.TimeSeriesView
    contents: list[str]
    fit: Callable[[Extents], Fit] | None
    """None if title and range are known before the run."""
    legend: list[PlotChannel]
    """Lines of its legend; none without a legend."""


class Plots:
    """Makes the plots of one layout.

    Parameters
    ----------
    view : View
        Properties of the run.

    Attributes
    ----------
    marked : dict of str
        Entity of the markers by the signals and quantities whose lines share a plot.
    """

    def __init__(self, view: View) -> None:
        self.view = view
        self._sizes = {of.name: of.size for of in (*common_signals(view.groups), *view.own)}
        self.marked: dict[tuple[str, ...], str] = {}
        self._plots: list[_Plot] = []
        self._states: list[rrb.StateTimelineView] = []
        self._squares: list[tuple[rrb.Spatial2DView, PlotChannel, float]] = []

    def signal(self, name: str) -> PlotLine:
        """Return the lines of a signal of the telemetry."""
        return PlotLine(TELEMETRY, name, self._sizes[name])

    def about_zero(
        self,
        what: str,
        unit: str,
        *lines: PlotLine,
        least: float,
        axis: int | None = None,
    ) -> rrb.TimeSeriesView:
        """Make a plot with the range of the settled run; its title says that values are outside.

        Parameters
        ----------
        what, unit : str
            Quantity and its unit.
        *lines : PlotLine
            The lines.
        least : float
            Half of the range at least.
        axis : int, optional
            Hinge whose entries are drawn; all unless given.

        Notes
        -----
        Plots of the other hinges have the same range, so that magnitudes can be compared. The title
        gives the range too: a low plot may have room for one number at its side.
        """

        def fit(extents: Extents) -> Fit:
            limit = extents.limit(*(PlotChannel(line.name) for line in lines), least=least)
            is_cut = extents.is_cut(limit, *(PlotChannel(line.name, axis) for line in lines))
            reach = (1 + ROOM) * limit
            return Fit(f"{name} ±{number(limit)} {unit}{CUT * is_cut}{colon}{key}", (-reach, reach))

        name, colon, key = what.partition(": ")  # the key may be cut in a small window, the range not
        return self._plot(f"{name} [{unit}]{colon}{key}", lines, axis, fit)

    def above_zero(self, what: str, unit: str, line: PlotLine, *, least: float) -> rrb.TimeSeriesView:
        """Make a plot of a quantity that is never negative, with the range of the settled run."""

        def fit(extents: Extents) -> Fit:
            limit = extents.limit(PlotChannel(line.name), least=least, above_zero=True)
            is_cut = extents.is_cut(limit, PlotChannel(line.name))
            return Fit(f"{what} [{unit}]{CUT * is_cut}", (-ROOM * limit, (1 + ROOM) * limit))

        return self._plot(f"{what} [{unit}]", (line,), None, fit)

    def whole(
        self,
        what: str,
        unit: str,
        *lines: PlotLine,
        least: float,
        axis: int | None = None,
    ) -> rrb.TimeSeriesView:
        """Make a plot with the full range of some lines, at least twice `least`."""

        def fit(extents: Extents) -> Fit:
            channels = [PlotChannel(line.name, axis) for line in lines]
            return Fit(title, extents.band(*channels, least=least))

        name, colon, key = what.partition(": ")
        title = f"{name} [{unit}]{colon}{key}"
        return self._plot(title, lines, axis, fit)

    def current_map(self, entity: str, what: str, span: Callable[[CurrentRanges], str]) -> rrb.TimeSeriesView:
        """Make a map of the currents, a row for each group; its title states the range of its colours."""
        band, limit_A = (-0.7, self.view.groups - 0.3), self.view.current_limit_A
        at_limit = CurrentRanges(limit_A, limit_A)

        def fit(extents: Extents) -> Fit:
            return Fit(f"{what}, {span(extents.currents or at_limit)}; limit {limit_A:g} A")

        axis_y = rrb.ScalarAxis(range=band)
        return self._plot(f"{what}, {span(at_limit)}", (PlotLine(entity, ""),), None, fit, axis_y)

    def fixed(self, title: str, *lines: PlotLine, low: float, high: float) -> rrb.TimeSeriesView:
        """Make a plot with a range that is known before the run."""
        return self._plot(title, lines, None, None, rrb.ScalarAxis(range=(low, high)))

    def states(self, name: str = "states") -> rrb.StateTimelineView:
        """Make a timeline with the lanes of states."""
        signals = [f"/{own.name}/**" for own in self.view.own if own.states]
        view = rrb.StateTimelineView(
            contents=[f"/{RUN}", f"/{LIMITS}", *signals], name=name, time_view=self._time_axis()
        )
        self._states.append(view)
        return view

    def square(self, view: rrb.Spatial2DView, channel: PlotChannel, least: float) -> rrb.Spatial2DView:
        """Let a view show half of the range of a channel to all sides of zero."""
        self._squares.append((view, channel, least))
        return view

    def changes(self, extents: Extents) -> dict[str, Any]:
        """Return what the extents of a run change in the layout, by the path in the layout."""
        changes: dict[str, Any] = {}
        axis = None
        if extents.ended_s is not None:
            axis = time_axis(shown_until_s(self.view.duration_s, extents.ended_s))
            changes |= {f"{view.blueprint_path()}/TimeAxis": axis for view in self._states}
        verticals = [f"/{ENDED}"] * (axis is not None) + [f"/{ONSETS}/**"] * extents.has_faults
        for view, contents, fit, legend in self._plots:
            path = view.blueprint_path()
            if fit:
                title, band = fit(extents)
                changes[path] = ViewBlueprint.from_fields(display_name=title)
                if band:
                    changes[f"{path}/ScalarAxis"] = rrb.ScalarAxis(range=band)
                if band and legend:
                    changes[f"{path}/PlotLegend"] = rrb.PlotLegend(extents.emptiest_corner(band, *legend))
            if axis:
                changes[f"{path}/TimeAxis"] = axis
            if verticals:
                changes[f"{path}/ViewContents"] = ViewContents(query=[*contents, *verticals])
        for square, channel, least in self._squares:
            size = extents.limit(channel, least=least) / 2
            title = f"±{number(size)} {square.name}"
            changes[square.blueprint_path()] = ViewBlueprint.from_fields(display_name=title)
            bounds = rrb.VisualBounds2D(x_range=[-size, size], y_range=[-size, size])
            changes[f"{square.blueprint_path()}/VisualBounds2D"] = bounds
        return changes

    def _plot(
        self,
        title: str,
        lines: tuple[PlotLine, ...],
        axis: int | None,
        fit: Callable[[Extents], Fit] | None,
        axis_y: rrb.ScalarAxis | None = None,
    ) -> rrb.TimeSeriesView:
        overrides: dict[str | rr.EntityPath, list[Visualizer]] = defaultdict(list)
        # Drawn in this order, as entities are in that of their names.
        fields = sorted((line for line in lines if line.name), key=lambda line: line.name)
        for line in fields:
            entity, visualizer = self._visualizer(line)
            overrides[f"/{entity}"].append(visualizer)
        contents = list(dict.fromkeys([*overrides, *(f"/{line.entity}" for line in lines if not line.name)]))
        marked = tuple(line.name for line in fields if line.size <= MOST_MARKED)
        if len(marked) > 1 or (axis is None and any(1 < line.size <= MOST_MARKED for line in fields)):
            contents.append(f"/{self.marked.setdefault(marked, f'{MARKS}/{len(self.marked)}')}")
        # A legend of one line would repeat the title, and one with the names of the hinges a key in a title.
        several = len(marked) == len(fields) and sum(line.size for line in fields) > 1
        has_key = KEY in title or all(line.name in AXES_ONLY for line in fields)
        has_legend = axis is None and several and not has_key
        one = [place == axis for place in range(len(ANGLES))]
        view = rrb.TimeSeriesView(
            origin="/",
            contents=contents,
            name=title,
            axis_x=self._time_axis(),
            axis_y=axis_y,
            # A legend would list what is invisible too, each row of a map, and each of many groups.
            plot_legend=None if has_legend else rrb.PlotLegend(visible=False),
            defaults=[]
            if axis is None
            else [
                rr.SeriesLines.from_fields(visible_series=one * (3 if self.view.decimated else 1)),
                rr.SeriesPoints.from_fields(visible_series=one * len(marked)),
            ],
            overrides=overrides or None,
        )
        legend = [PlotChannel(line.name) for line in fields] if has_legend else []
        self._plots.append(_Plot(view, contents, fit, legend))
        return view

    def _visualizer(self, line: PlotLine) -> tuple[str, Visualizer]:
        """Return entity and visualizer of lines: of every row, or of an envelope."""
        mappings = _mappings(line.name)
        if self.view.decimated:
            return ENVELOPE, rr.SeriesLines(interpolation_mode="StepAfter").visualizer(mappings=mappings)
        return line.entity, rr.SeriesLines().visualizer(mappings=mappings)

    def _time_axis(self) -> rrb.TimeAxis | None:
        """Return an axis that follows the cursor in a live view.

        Otherwise None: the axis is as long as the data, and needs no room in the file.
        """
        return following_axis(self.view.shown_s) if self.view.live else None


def time_axis(until_s: float) -> rrb.TimeAxis:
    """Time axis from 0 to a time."""
    boundary = rrb.TimeRangeBoundary
    whole = rr.TimeRange(start=boundary.absolute(seconds=0), end=boundary.absolute(seconds=until_s))
    return rrb.TimeAxis(view_range=whole)


def following_axis(window_s: float) -> rrb.TimeAxis:
    """Time axis over a window that ends at the cursor."""
    boundary = rrb.TimeRangeBoundary
    window = rr.TimeRange(start=boundary.cursor_relative(seconds=-window_s), end=boundary.cursor_relative())
    return rrb.TimeAxis(view_range=window)


def time_range(oldest_s: float, newest_s: float = 0.0) -> rrb.VisibleTimeRanges:
    """Return the range of the data that a view shows, by their ages at the cursor."""
    boundary = rrb.TimeRangeBoundary
    start = boundary.cursor_relative(seconds=-oldest_s)
    end = boundary.cursor_relative(seconds=-newest_s)
    return rrb.VisibleTimeRanges(timeline=TIMELINE, start=start, end=end)


def _mappings(name: str) -> list[VisualizerComponentMapping]:
    """Map lines to fields of the components of their entity: values and a style."""
    mappings = [_mapping(VALUES, name, "", "Scalars:scalars")]
    return mappings + [_mapping(STYLES, name, f".{look}", f"SeriesLines:{look}") for look in LINE_LOOKS]


def _mapping(kind: str, name: str, of: str, target: str) -> VisualizerComponentMapping:
    """Return the source of a visualizer's component; plotted signals exist from the start."""
    source, selector = component(kind, 0), f".{name}{of}[]"
    return VisualizerComponentMapping(
        target, ComponentSourceKind.SourceComponent, source_component=source, selector=selector
    )
