"""The traces of the shaft's tip: what is shown of which age, at which rate, in which colour."""

from __future__ import annotations

from typing import NamedTuple

from spheretwin.viz import palette
from spheretwin.viz.scene.paths import WORLD

TRAIL_S = 2.0
"""What is older is not shown."""


class Trace(NamedTuple):
    """Part of a way, between two ages."""

    entity: str
    signal: str
    """Hinge angles, rad."""
    newest_s: float
    oldest_s: float
    rate_Hz: float
    colour: palette.Colour
    width: float
    """Radius in points of the screen."""


_FADED = [palette.mixed(palette.TRACE, palette.DESIRED_TRACE, share) for share in (0.0, 0.4, 0.75)]

TRACES: tuple[Trace, ...] = (
    Trace(f"{WORLD}/tip/new", "q_rad", 0.0, 0.6, 30.0, _FADED[0], 2.4),
    Trace(f"{WORLD}/tip/older", "q_rad", 0.6, 1.2, 15.0, _FADED[1], 1.7),
    Trace(f"{WORLD}/tip/oldest", "q_rad", 1.2, TRAIL_S, 15.0, _FADED[2], 1.2),
    Trace(f"{WORLD}/tip_desired", "q_ref_rad", 0.0, TRAIL_S, 15.0, palette.DESIRED_TRACE, 0.7),
)
"""The older, the thinner and greyer, which is fainter on any ground; each age has segments of its own."""
