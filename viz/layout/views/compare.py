"""What happens beside what is desired, and beside what the controller believes."""

from __future__ import annotations

import rerun.blueprint as rrb

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.viz.layout.plots import Line, Plots, quantity, signal
from spheretwin.viz.quantities.tip_distance import TIP_DISTANCE

LEAST_rad = 0.02

ANGLE_SIGNALS = ("q_governed_rad", "q_predicted_rad", "q_measured_rad")


def compare(plots: Plots) -> rrb.Container:
    """Angles of each axis, white as desired; below, how far apart the shaft's tips are."""
    angles = _lines(plots, ("q_rad", "q_ref_rad", *ANGLE_SIGNALS))
    key = ", white desired, amber believed" if len(angles) > 2 else ", white desired"
    angles_of_each = [
        plots.whole(name, "rad", *angles, least=LEAST_rad, axis=axis, key=key)
        for axis, name in enumerate(ANGLES)
    ]
    apart = plots.above_zero("shaft's tip from where it should be", "mm", quantity(TIP_DISTANCE), least=0.01)
    return rrb.Vertical(rrb.Horizontal(*angles_of_each), apart, row_shares=[3, 2], name="compare")


def _lines(plots: Plots, names: tuple[str, ...]) -> list[Line]:
    return [signal(name) for name in names if name in plots.view.names]
