"""Plots over time: their lines, ranges and titles."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.archetypes import ViewBlueprint, ViewContents
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

from spheretwin.models.telemetry.signals import ANGLES, AXES, Signal
from spheretwin.viz import theme
from spheretwin.viz.layout.extents import ROOM, Extents, PlotChannel, number
from spheretwin.viz.layout.view import (
    ENDED,
    STATES,
    STYLES,
    TELEMETRY,
    TIMELINE,
    VALUES,
    View,
    component,
    derived,
    shown_until_s,
)
from spheretwin.viz.quantities import Quantity

LOOKS = ("names", "colors", "widths", "aggregation_policy")
"""Properties of `rr.SeriesLines` in a style."""

WIDEST, THICK, MIDDLE, THIN = 5.0, 3.0, 1.5, 1.0

_COMMANDED = ("q_ref_rad", "qdot_ref_rad_s", "torque_command_Nm", "current_command_A")
_ESTIMATED = ("q_measured_rad", "qdot_estimated_rad_s", "q_predicted_rad", "qdot_predicted_rad_s")
_SECONDARY = ("disturbance_Nm", "q_governed_rad", "qdot_governed_rad_s", "qddot_governed_rad_s2")

# Lines are drawn in the order of their names: estimates first, as a rim of the true values,
# and commands last and thin.
_ACTUAL = ("q_rad", "qdot_rad_s", "torque_delivered_Nm")


def signal_style(signal: Signal) -> rr.SeriesLines:
    """Return names with units, colours and widths of a signal's lines."""
    names = _names(_short(signal.name), signal.labels or ("",), signal.unit)
    return _style(names, _colours(signal), _width(signal.name))


@cache
def quantity_style(quantity: Quantity) -> rr.SeriesLines:
    """Return names with units, colours and width of a derived quantity's lines."""
    names = _names(_short(quantity.name), quantity.labels, quantity.unit)
    return _style(names, list(quantity.colours), _width(quantity.name))


def _style(names: list[str], colours: list[theme.Colour], width: float) -> rr.SeriesLines:
    # A command that swings from tick to tick is its mean where ticks share a pixel: this moves the rotor.
    aggregation = rr.components.AggregationPolicy.Average if width == THIN else None
    return rr.SeriesLines(
        names=names, colors=colours, widths=[width] * len(names), aggregation_policy=aggregation
    )


def _names(short: str, labels: tuple[str, ...], unit: str) -> list[str]:
    return [f"{short} {label} [{unit}]".replace("  ", " ") for label in labels]


def _short(name: str) -> str:
    """Return the name without its unit, which follows in brackets."""
    for suffix in ("_rad_s", "_mrad", "_rad", "_Nm", "_deg", "_mm", "_A", "_W", "_s"):
        if name.endswith(suffix):
            return name.removesuffix(suffix)
    return name


def _colours(signal: Signal) -> list[theme.Colour]:
    for names, colour in (
        (_COMMANDED, theme.COMMAND),
        (_ESTIMATED, theme.ESTIMATE),
        (_SECONDARY, theme.DESIRED_TRACE),
    ):
        if signal.name in names:
            return [colour] * signal.size
    if signal.size == 3 and signal.labels in ((), ANGLES, AXES):
        return list(theme.AXIS_COLOURS)
    return [theme.PLAIN if signal.size == 1 else theme.GROUP] * signal.size


def _width(name: str) -> float:
    for names, width in ((_ESTIMATED, WIDEST), (_ACTUAL, THICK), (_COMMANDED, THIN)):
        if name in names:
            return width
    return MIDDLE


Range = tuple[float, float]

_NO_LEGEND = rrb.PlotLegend(visible=False)
"""A legend would cover data; titles and the colours of the axes say the same."""


class PlotLine(NamedTuple):
    """Line of a plot: an entity, or a signal of the telemetry; its bounds have this name."""

    entity: str
    name: str


def signal(name: str) -> PlotLine:
    """Return the line of a signal of the telemetry."""
    return PlotLine(TELEMETRY, name)


def quantity(of: Quantity) -> PlotLine:
    """Return the line of a derived quantity."""
    return PlotLine(derived(of.name), of.name)


class Fit(NamedTuple):
    """Properties of a plot that follow from the extents of a run."""

    title: str
    band: Range


class _Plot(NamedTuple):
    view: rrb.TimeSeriesView
    contents: list[str]
    fit: Callable[[Extents], Fit] | None
    """None if title and range are known before the run."""


class Plots:
    """Makes the plots of one layout.

    Parameters
    ----------
    view : View
        Properties of the run.
    """

    def __init__(self, view: View) -> None:
        self.view = view
        self._plots: list[_Plot] = []
        self._states: list[rrb.StateTimelineView] = []
        self._squares: list[tuple[rrb.Spatial2DView, PlotChannel, float]] = []

    def about_zero(
        self,
        what: str,
        unit: str,
        *lines: PlotLine,
        least: float,
        axis: int | None = None,
        key: str = "",
    ) -> rrb.TimeSeriesView:
        """Make a plot with the range of the settled run; its title gives the extent outside.

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
        key : str
            End of the title: identifies the lines.

        Notes
        -----
        Plots of the other hinges have the same range, so that magnitudes can be compared. The title
        gives the range too: a low plot may have room for one number at its side.
        """

        def fit(extents: Extents) -> Fit:
            limit = extents.limit(*(PlotChannel(line.name) for line in lines), least=least)
            suffix = extents.largest(limit, *(PlotChannel(line.name, axis) for line in lines))
            reach = (1 + ROOM) * limit
            return Fit(f"{what} ±{number(limit)} {unit}{suffix}{key}", (-reach, reach))

        return self._plot(f"{what} [{unit}]{key}", lines, axis, fit)

    def above_zero(self, what: str, unit: str, line: PlotLine, *, least: float) -> rrb.TimeSeriesView:
        """Make a plot of a quantity that is never negative, with the range of the settled run."""

        def fit(extents: Extents) -> Fit:
            limit = extents.limit(PlotChannel(line.name), least=least, above_zero=True)
            suffix = extents.largest(limit, PlotChannel(line.name))
            return Fit(f"{what} [{unit}]{suffix}", (-ROOM * limit, (1 + ROOM) * limit))

        return self._plot(f"{what} [{unit}]", (line,), None, fit)

    def whole(
        self,
        what: str,
        unit: str,
        *lines: PlotLine,
        least: float,
        axis: int | None = None,
        key: str = "",
    ) -> rrb.TimeSeriesView:
        """Make a plot with the full range of some lines, at least twice `least`."""

        def fit(extents: Extents) -> Fit:
            channels = [PlotChannel(line.name, axis) for line in lines]
            low, high = extents.bounds(*channels)
            title = f"{what} [{unit}], {number(low)} to {number(high)}{key}"
            return Fit(title, extents.band(*channels, least=least))

        return self._plot(f"{what} [{unit}]{key}", lines, axis, fit)

    def fixed(self, title: str, *lines: PlotLine, low: float, high: float) -> rrb.TimeSeriesView:
        """Make a plot with a range that is known before the run."""
        return self._plot(title, lines, None, None, rrb.ScalarAxis(range=(low, high)))

    def states(self, name: str = "states") -> rrb.StateTimelineView:
        """Make a timeline with the lanes of states."""
        view = rrb.StateTimelineView(origin=f"/{STATES}", name=name, time_view=self._time_axis())
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
        for view, contents, fit in self._plots:
            path = view.blueprint_path()
            if fit:
                title, band = fit(extents)
                changes[path] = ViewBlueprint.from_fields(display_name=title)
                changes[f"{path}/ScalarAxis"] = rrb.ScalarAxis(range=band)
            if axis:
                changes[f"{path}/TimeAxis"] = axis
                changes[f"{path}/ViewContents"] = ViewContents(query=[*contents, f"/{ENDED}"])
        for square, channel, least in self._squares:
            size = extents.limit(channel, least=least) / 2
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
        contents = list(dict.fromkeys(f"/{line.entity}" for line in lines))
        # Drawn in this order, as entities are in that of their names.
        names = sorted(line.name for line in lines if line.entity == TELEMETRY)
        signals = [rr.SeriesLines().visualizer(mappings=_mappings(name)) for name in names]
        one = [place == axis for place in range(len(ANGLES))]
        view = rrb.TimeSeriesView(
            origin="/",
            contents=contents,
            name=title,
            axis_x=self._time_axis(),
            axis_y=axis_y,
            plot_legend=_NO_LEGEND,
            defaults=[] if axis is None else [rr.SeriesLines.from_fields(visible_series=one)],
            overrides={f"/{TELEMETRY}": signals} if signals else None,
        )
        self._plots.append(_Plot(view, contents, fit))
        return view

    def _time_axis(self) -> rrb.TimeAxis | None:
        """Return an axis over the planned time in a live view.

        Otherwise None: the axis is as long as the data, and needs no room in the file.
        """
        return time_axis(self.view.duration_s) if self.view.live else None


def time_axis(until_s: float) -> rrb.TimeAxis:
    """Time axis from 0 to a time."""
    boundary = rrb.TimeRangeBoundary
    whole = rr.TimeRange(start=boundary.absolute(seconds=0), end=boundary.absolute(seconds=until_s))
    return rrb.TimeAxis(view_range=whole)


def time_range(oldest_s: float, newest_s: float = 0.0) -> rrb.VisibleTimeRanges:
    """Return the range of the data that a view shows, by their ages at the cursor."""
    boundary = rrb.TimeRangeBoundary
    start = boundary.cursor_relative(seconds=-oldest_s)
    end = boundary.cursor_relative(seconds=-newest_s)
    return rrb.VisibleTimeRanges(timeline=TIMELINE, start=start, end=end)


def _mappings(name: str) -> list[VisualizerComponentMapping]:
    """Map the lines of a signal to fields of the telemetry's components."""
    looks = [f"SeriesLines:{look}" for look in LOOKS]
    mappings = [_mapping(VALUES, name, "", "Scalars:scalars")]
    mappings += [
        _mapping(STYLES, name, f".{look}", target) for look, target in zip(LOOKS, looks, strict=True)
    ]
    return mappings


def _mapping(kind: str, name: str, of: str, target: str) -> VisualizerComponentMapping:
    """Return the source of a visualizer's component; plotted signals exist from the start."""
    source, selector = component(kind, 0), f".{name}{of}[]"
    return VisualizerComponentMapping(
        target, ComponentSourceKind.SourceComponent, source_component=source, selector=selector
    )
