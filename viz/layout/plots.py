"""Plots over time: their lines, ranges and titles."""

from __future__ import annotations

from typing import NamedTuple

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

from spheretwin.models.telemetry.signals import ANGLES, AXES, Signal
from spheretwin.viz import theme
from spheretwin.viz.layout.extents import ROOM, Extents, PlotChannel, number
from spheretwin.viz.layout.view import (
    ENDED,
    STATES,
    STYLES,
    TELEMETRY,
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


class Plots:
    """Makes the plots of one layout.

    Parameters
    ----------
    view : View
        Properties of the run.
    extents : Extents, optional
        Extents of the run; without them, ranges follow the data.
    """

    def __init__(self, view: View, extents: Extents | None) -> None:
        self.view, self.extents = view, extents

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
        *lines : Line
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
        if self.extents is None:
            return self._plot(f"{what} [{unit}]{key}", lines, axis, None)
        limit = self.extents.limit(*(PlotChannel(line.name) for line in lines), least=least)
        suffix = self.extents.largest(limit, *(PlotChannel(line.name, axis) for line in lines))
        reach = (1 + ROOM) * limit
        return self._plot(f"{what} ±{number(limit)} {unit}{suffix}{key}", lines, axis, (-reach, reach))

    def above_zero(self, what: str, unit: str, line: PlotLine, *, least: float) -> rrb.TimeSeriesView:
        """Make a plot of a quantity that is never negative, with the range of the settled run."""
        if self.extents is None:
            return self._plot(f"{what} [{unit}]", (line,), None, None)
        limit = self.extents.limit(PlotChannel(line.name), least=least, above_zero=True)
        suffix = self.extents.largest(limit, PlotChannel(line.name))
        return self._plot(f"{what} [{unit}]{suffix}", (line,), None, (-ROOM * limit, (1 + ROOM) * limit))

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
        if self.extents is None:
            return self._plot(f"{what} [{unit}]{key}", lines, axis, None)
        channels = [PlotChannel(line.name, axis) for line in lines]
        low, high = self.extents.bounds(*channels)
        title = f"{what} [{unit}], {number(low)} to {number(high)}{key}"
        return self._plot(title, lines, axis, self.extents.band(*channels, least=least))

    def fixed(self, title: str, *lines: PlotLine, low: float, high: float) -> rrb.TimeSeriesView:
        """Make a plot with a range that is known before the run."""
        return self._plot(title, lines, None, (low, high))

    def states(self, name: str = "states") -> rrb.StateTimelineView:
        """Make a timeline with the lanes of states."""
        axis = self._time_axis()
        return rrb.StateTimelineView(origin=f"/{STATES}", name=name, time_view=axis)

    def _plot(
        self,
        title: str,
        lines: tuple[PlotLine, ...],
        axis: int | None,
        band: Range | None,
    ) -> rrb.TimeSeriesView:
        contents = list(dict.fromkeys(f"/{line.entity}" for line in lines))
        if band and self.extents and self.extents.ended_s is not None:
            contents.append(f"/{ENDED}")
        # Drawn in this order, as entities are in that of their names.
        names = sorted(line.name for line in lines if line.entity == TELEMETRY)
        signals = [rr.SeriesLines().visualizer(mappings=_mappings(name)) for name in names]
        one = [place == axis for place in range(len(ANGLES))]
        return rrb.TimeSeriesView(
            origin="/",
            contents=contents,
            name=title,
            axis_x=self._time_axis(),
            axis_y=rrb.ScalarAxis(range=band) if band else None,
            plot_legend=_NO_LEGEND,
            defaults=[] if axis is None else [rr.SeriesLines.from_fields(visible_series=one)],
            overrides={f"/{TELEMETRY}": signals} if signals else None,
        )

    def _time_axis(self) -> rrb.TimeAxis | None:
        """Return an axis over the planned time in a live view, or until after an early end.

        Otherwise None: the axis is as long as the data, and needs no room in the file.
        """
        if self.extents and self.extents.ended_s is not None:
            last_s = shown_until_s(self.view.duration_s, self.extents.ended_s)
        elif self.view.live:
            last_s = self.view.duration_s
        else:
            return None
        boundary = rrb.TimeRangeBoundary
        whole = rr.TimeRange(start=boundary.absolute(seconds=0), end=boundary.absolute(seconds=last_s))
        return rrb.TimeAxis(view_range=whole)


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
