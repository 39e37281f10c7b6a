"""Names, colours and widths of plotted lines."""

import rerun as rr

from spheretwin.models.telemetry.signals import ANGLES, AXES, Signal
from spheretwin.viz import palette
from spheretwin.viz.quantities.quantity import Quantity

LOOKS = ("names", "colors", "widths", "aggregation_policy")
"""What of `rr.SeriesLines` a style says."""

WIDEST, THICK, MIDDLE, THIN = 5.0, 3.0, 1.5, 1.0

_ASKED = ("q_ref_rad", "qdot_ref_rad_s", "torque_command_Nm", "current_command_A")
_BELIEVED = ("q_measured_rad", "qdot_estimated_rad_s", "q_predicted_rad", "qdot_predicted_rad_s")
_BESIDE = ("disturbance_Nm", "q_governed_rad", "qdot_governed_rad_s", "qddot_governed_rad_s2")

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


def _style(names: list[str], colours: list[palette.Colour], width: float) -> rr.SeriesLines:
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


def _colours(signal: Signal) -> list[palette.Colour]:
    for names, colour in (
        (_ASKED, palette.ASKED),
        (_BELIEVED, palette.BELIEVED),
        (_BESIDE, palette.DESIRED_TRACE),
    ):
        if signal.name in names:
            return [colour] * signal.size
    if signal.size == 3 and signal.labels in ((), ANGLES, AXES):
        return list(palette.AXIS_COLOURS)
    return [palette.PLAIN if signal.size == 1 else palette.GROUP] * signal.size


def _width(name: str) -> float:
    for names, width in ((_BELIEVED, WIDEST), (_ACTUAL, THICK), (_ASKED, THIN)):
        if name in names:
            return width
    return MIDDLE
