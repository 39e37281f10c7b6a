"""Plots over time: what stands in one, in which range, and what its title says."""

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
"""What of `rr.SeriesLines` a style says."""

WIDEST, THICK, MIDDLE, THIN = 5.0, 3.0, 1.5, 1.0

_COMMANDED = ("q_ref_rad", "qdot_ref_rad_s", "torque_command_Nm", "current_command_A")
_ESTIMATED = ("q_measured_rad", "qdot_estimated_rad_s", "q_predicted_rad", "qdot_predicted_rad_s")
_SECONDARY = ("disturbance_Nm", "q_governed_rad", "qdot_governed_rad_s", "qddot_governed_rad_s2")

# Lines are drawn in the order of their names: what the controller believes first, as a rim of what is true,
# and what was asked for last and thin.
_ACTUAL = ("q_rad", "qdot_rad_s", "torque_delivered_Nm")


def signal_style(signal: Signal) -> rr.SeriesLines:
    """Names with units, colours and widths of a signal's lines."""
    names = _names(_short(signal.name), signal.labels or ("",), signal.unit)
    return _style(names, _colours(signal), _width(signal.name))


def quantity_style(quantity: Quantity) -> rr.SeriesLines:
    """Names with units, colours and width of a derived quantity's lines."""
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
    """Name without its unit, which stands in brackets behind it."""
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
"""It would lie over data, and titles and the colours of the axes tell what it says."""


class PlotLine(NamedTuple):
    """What is drawn: an entity, or a signal of the telemetry; its bounds are known under the name."""

    entity: str
    name: str


def signal(name: str) -> PlotLine:
    """A signal of the telemetry."""
    return PlotLine(TELEMETRY, name)


def quantity(of: Quantity) -> PlotLine:
    """A derived quantity."""
    return PlotLine(derived(of.name), of.name)


class Plots:
    """Makes the plots of one layout.

    Parameters
    ----------
    view : View
        What the layout is made for.
    seen : Extents, optional
        What the run has shown; without it, ranges follow the data.
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
        """Plot whose range is that of the settled run; its title says what lies outside.

        Parameters
        ----------
        what, unit : str
            What is drawn, in which unit.
        *lines : Line
            The lines.
        least : float
            Half of the range at least.
        axis : int, optional
            The hinge whose entries are drawn; all of them unless given.
        key : str
            Ends the title: which line is which.

        Notes
        -----
        Plots of the other hinges have the same range, so that what is small looks small. The title
        tells the range too: a low plot may have room for one number at its side.
        """
        if self.extents is None:
            return self._plot(f"{what} [{unit}]{key}", lines, axis, None)
        limit = self.extents.limit(*(PlotChannel(line.name) for line in lines), least=least)
        suffix = self.extents.largest(limit, *(PlotChannel(line.name, axis) for line in lines))
        reach = (1 + ROOM) * limit
        return self._plot(f"{what} ±{number(limit)} {unit}{suffix}{key}", lines, axis, (-reach, reach))

    def above_zero(self, what: str, unit: str, line: PlotLine, *, least: float) -> rrb.TimeSeriesView:
        """Plot of what is never negative, its range that of the settled run."""
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
        """Plot of all that some lines have shown, over a range of twice `least` at least."""
        if self.extents is None:
            return self._plot(f"{what} [{unit}]{key}", lines, axis, None)
        channels = [PlotChannel(line.name, axis) for line in lines]
        low, high = self.extents.bounds(*channels)
        title = f"{what} [{unit}], {number(low)} to {number(high)}{key}"
        return self._plot(title, lines, axis, self.extents.band(*channels, least=least))

    def fixed(self, title: str, *lines: PlotLine, low: float, high: float) -> rrb.TimeSeriesView:
        """Plot of a range that is known before the run."""
        return self._plot(title, lines, None, (low, high))

    def states(self, name: str = "states") -> rrb.StateTimelineView:
        """Lanes of states."""
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
        """Axis over the time that is planned, while it is watched, or until behind an early end.

        Else none: it is as long as the data, and takes no room in the file.
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
    """What the lines of a signal are drawn from: fields of the telemetry's components."""
    looks = [f"SeriesLines:{look}" for look in LOOKS]
    mappings = [_mapping(VALUES, name, "", "Scalars:scalars")]
    mappings += [
        _mapping(STYLES, name, f".{look}", target) for look, target in zip(LOOKS, looks, strict=True)
    ]
    return mappings


def _mapping(kind: str, name: str, of: str, target: str) -> VisualizerComponentMapping:
    """Where a visualizer takes something from; plotted signals are there from the start."""
    source, selector = component(kind, 0), f".{name}{of}[]"
    return VisualizerComponentMapping(
        target, ComponentSourceKind.SourceComponent, source_component=source, selector=selector
    )
