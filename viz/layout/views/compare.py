"""What happens beside what is desired, and beside what the controller believes."""

from __future__ import annotations

import rerun.blueprint as rrb

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.viz.layout.plots import Line, Plots, quantity, signal
from spheretwin.viz.quantities.tip_distance import TIP_DISTANCE

LEAST_rad, LEAST_rad_s = 0.02, 0.05

ANGLE_SIGNALS = ("q_rad", "q_ref_rad", "q_governed_rad", "q_predicted_rad", "q_measured_rad")
RATE_SIGNALS = (
    "qdot_rad_s",
    "qdot_ref_rad_s",
    "qdot_governed_rad_s",
    "qdot_predicted_rad_s",
    "qdot_estimated_rad_s",
)


def compare(plots: Plots) -> rrb.Container:
    """Angles and rates of each axis, white as asked; below, how far apart the shaft's tips are."""
    angles, rates = _lines(plots, ANGLE_SIGNALS), _lines(plots, RATE_SIGNALS)
    angles_of_each = [
        plots.whole(name, "rad", *angles, least=LEAST_rad, axis=axis) for axis, name in enumerate(ANGLES)
    ]
    rates_of_each = [
        plots.about_zero(f"rate of {name}", "rad/s", *rates, least=LEAST_rad_s, axis=axis)
        for axis, name in enumerate(ANGLES)
    ]
    apart = plots.above_zero(
        "shaft's tip from where it should be", "mm", quantity(TIP_DISTANCE), least=TIP_DISTANCE.floor
    )
    above = rrb.Horizontal(*angles_of_each), rrb.Horizontal(*rates_of_each)
    return rrb.Vertical(*above, apart, row_shares=[4, 4, 3], name="compare")


def _lines(plots: Plots, names: tuple[str, ...]) -> list[Line]:
    return [signal(name) for name in names if name in plots.view.names]
