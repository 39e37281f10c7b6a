"""Styles of the lines of plots: names with units, colours, widths and markers."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import pyarrow as pa
import rerun as rr
from rerun.components import AggregationPolicy, MarkerShape

from spheretwin.models.telemetry.signals import ANGLES, AXES, Signal
from spheretwin.viz import theme
from spheretwin.viz.quantities import Quantity

LINE_LOOKS = ("names", "colors", "widths", "aggregation_policy")
"""Properties of `rr.SeriesLines` in a style."""

OPAQUE, BAND = 255, 90
"""Opacities of lines, and of a noisy signal: its rows fill a band behind the other lines."""

WIDEST, THICK, MIDDLE, THIN = 5.0, 3.0, 1.5, 1.0

_MARK_SIZE = 4.5

MOST_MARKED = 3
"""Entries up to which the lines of a signal have markers: of many coil groups only the spread matters."""

_COMMANDED = ("q_ref_rad", "qdot_ref_rad_s", "torque_command_Nm", "current_command_A")
_ESTIMATED = ("q_measured_rad", "q_predicted_rad", "qdot_predicted_rad_s")
_NOISY = ("qdot_estimated_rad_s",)
_SECONDARY = (
    "disturbance_Nm",
    "q_governed_rad",
    "qdot_governed_rad_s",
    "qddot_governed_rad_s2",
    "rotor_temperature_degC",  # in a plot with that of the stator
)

_ACTUAL = ("q_rad", "qdot_rad_s", "torque_delivered_Nm")


class _Role(NamedTuple):
    """Style of the lines with one role in a plot, besides their own colours and markers."""

    names: Sequence[str]
    colour: theme.Colour | None
    marker: MarkerShape | None
    width: float
    opacity: int = OPAQUE


# Lines are drawn in the order of their names: estimates first, as a rim of the true values,
# and commands last and thin.
_ROLES = (
    _Role(_COMMANDED, theme.COMMAND, MarkerShape.Cross, THIN),
    _Role(_ESTIMATED, theme.ESTIMATE, MarkerShape.Square, WIDEST),
    _Role(_NOISY, theme.ESTIMATE, MarkerShape.Square, THIN, BAND),
    _Role(_SECONDARY, theme.DESIRED_TRACE, MarkerShape.Plus, MIDDLE),
    _Role(_ACTUAL, None, MarkerShape.Circle, THICK),  # with its command in a plot for each hinge
)
_NO_ROLE = _Role((), None, None, MIDDLE)

AXES_ONLY = (
    "error_mrad",
    "coupling_torque_Nm",
    "rate_error_rad_s",
    "measurement_error_mrad",
    "sliding_s",
    "friction_Nm",
    "presliding_rad",
    "cable_Nm",
)
"""Lines of the hinges with a plot of their own, whose title names them: they have the names of the hinges."""

_AXIS_MARKERS = (MarkerShape.Circle, MarkerShape.Diamond, MarkerShape.Up)


class LineStyle(NamedTuple):
    """Style of the lines of a signal or quantity, one for each entry."""

    names: list[str]
    colours: list[theme.Colour]
    markers: list[MarkerShape]
    width: float
    opacity: int = OPAQUE

    def lines(self) -> rr.SeriesLines:
        """Return the style of the lines: of rows that share a pixel all are drawn, from least to greatest."""
        return rr.SeriesLines(
            names=self.names,
            colors=self._colours(),
            widths=[self.width] * len(self.names),
            aggregation_policy=AggregationPolicy.MinMax,
        )

    def of_envelope(self) -> rr.SeriesLines:
        """Return the style of an envelope: least values, means and greatest values, the bounds thin."""
        count = len(self.names)
        return rr.SeriesLines(
            names=self.names * 3,
            colors=self._colours() * 3,
            widths=[THIN] * count + [max(self.width, MIDDLE)] * count + [THIN] * count,
            aggregation_policy=AggregationPolicy.MinMax,
        )

    def _colours(self) -> list[tuple[int, int, int, int]]:
        return [(*colour, self.opacity) for colour in self.colours]


def mark_style(styles: Sequence[LineStyle]) -> rr.SeriesPoints:
    """Return the style of the markers on the lines of some styles."""
    return rr.SeriesPoints(
        names=[name for style in styles for name in style.names],
        colors=[colour for style in styles for colour in style.colours],
        markers=[marker for style in styles for marker in style.markers],
        marker_sizes=[_MARK_SIZE] * sum(len(style.names) for style in styles),
    )


@cache
def signal_style(signal: Signal) -> LineStyle:
    """Return the style of a signal's lines."""
    names = _names(signal.name, signal.labels or ("",), signal.unit)
    role, markers = _role(signal.name), _markers(signal.name, signal.size)
    return LineStyle(names, _colours(signal), markers, role.width, role.opacity)


@cache
def quantity_style(quantity: Quantity) -> LineStyle:
    """Return the style of the lines of a derived quantity."""
    names = _names(quantity.name, quantity.labels, quantity.unit)
    markers = _markers(quantity.name, quantity.size)
    return LineStyle(names, list(quantity.colours), markers, _role(quantity.name).width)


def as_struct(lines: rr.SeriesLines) -> pa.Array:
    """Return a style as lists in a struct, to which a layout can refer."""
    return pa.StructArray.from_arrays([_look(getattr(lines, look)) for look in LINE_LOOKS], list(LINE_LOOKS))


def _look(batch: rr.ComponentBatchLike) -> pa.Array:
    values = batch.as_arrow_array()
    return pa.FixedSizeListArray.from_arrays(values, len(values))


def _names(name: str, labels: tuple[str, ...], unit: str) -> list[str]:
    short = "" if name in AXES_ONLY else f"{_short(name)} "
    return [f"{short}{label} [{unit}]".replace("  ", " ") for label in labels]


def _short(name: str) -> str:
    """Return the name without its unit, which follows in brackets."""
    for suffix in ("_rad_s", "_mrad", "_rad", "_Nm", "_deg", "_mm", "_degC", "_A", "_W", "_s"):
        if name.endswith(suffix):
            return name.removesuffix(suffix)
    return name


def _role(name: str) -> _Role:
    return next((role for role in _ROLES if name in role.names), _NO_ROLE)


def _colours(signal: Signal) -> list[theme.Colour]:
    if colour := _role(signal.name).colour:
        return [colour] * signal.size
    if signal.size == len(ANGLES) and signal.labels in ((), ANGLES, AXES):
        return list(theme.AXIS_COLOURS)
    return [theme.PLAIN if signal.size == 1 else theme.GROUP] * signal.size


def _markers(name: str, size: int) -> list[MarkerShape]:
    own = _role(name).marker
    if own is None and size == len(_AXIS_MARKERS):
        return list(_AXIS_MARKERS)
    return [own or MarkerShape.Circle] * size
