"""What is drawn beside the actuator to read it by: axes, and the scale of the coils' colours."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.viz import palette

Array = NDArray[np.float64]

AXES_LENGTH_m = 0.05
"""Of the stator's: the measure of all that is drawn."""

REACH_m = 0.12
"""From the joint to the farthest that an actuator has, of one beside which the lengths here are right."""

# A bar before the foot, square to the eye of the layout; its ends are the current limit.
MIDDLE_m = np.array([0.064, -0.064, -0.078])
ALONG = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
UP = np.array([-0.4, 0.4, 0.82])
LENGTH_m, HEIGHT_m = 0.14, 0.008
STRIPES = 32
TICKS = (-1.0, -0.5, 0.0, 0.5, 1.0)


def size_of(actuator: Actuator) -> float:
    """How many times as large as the lengths here what is drawn beside an actuator is."""
    coils_m = actuator.coil.distance_m + actuator.coil.length_m / 2
    return max(float(np.linalg.norm(actuator.shaft_tip_m)), coils_m) / REACH_m


def axes(origin_m: Sequence[float] | Array, length_m: float) -> rr.Arrows3D:
    """Axes of a frame in the colours of the plots."""
    return rr.Arrows3D(
        origins=[origin_m] * 3,
        vectors=length_m * np.eye(3),
        colors=palette.AXIS_COLOURS,
        radii=rr.Radius.ui_points(1.5),
    )


def labels(texts: Sequence[str], colours: Sequence[palette.Colour]) -> rr.Points3D:
    """Texts for the heads of arrows, as points without a size: an arrow's own text stands in its middle."""
    size = rr.Radius.ui_points(0.0)
    return rr.Points3D.from_fields(labels=texts, colors=colours, radii=size, show_labels=True)


def current_scale(size: float) -> rr.Mesh3D:
    """Bar in the colours of all currents within the limit, for an actuator of a size."""
    share = np.linspace(-1.0, 1.0, STRIPES + 1)
    lower = MIDDLE_m + LENGTH_m / 2 * share[:, None] * ALONG
    first = np.arange(STRIPES)
    one, other = (
        [first, first + 1, first + STRIPES + 1],
        [first + 1, first + STRIPES + 2, first + STRIPES + 1],
    )
    return rr.Mesh3D(
        vertex_positions=size * np.concatenate([lower, lower + HEIGHT_m * UP]),
        triangle_indices=np.concatenate([np.stack(corners, axis=1) for corners in (one, other)]),
        vertex_colors=np.tile(palette.current_colours(share, 1.0), (2, 1)),
    )


def current_scale_labels(limit_A: float, size: float) -> rr.Points3D:
    """Currents along the bar."""
    at = np.array(TICKS)
    return rr.Points3D(
        size * (MIDDLE_m + LENGTH_m / 2 * at[:, None] * ALONG - 0.3 * HEIGHT_m * UP),
        labels=[f"{share * limit_A:+g} A" if share else "0" for share in at.tolist()],
        colors=[palette.DESIRED_TRACE],
        radii=rr.Radius.ui_points(1.0),
        show_labels=True,
    )
