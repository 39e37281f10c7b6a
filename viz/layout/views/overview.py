"""What this run is, whether it is good, and where it is bad."""

from __future__ import annotations

import rerun.blueprint as rrb

from spheretwin.viz.layout import panels
from spheretwin.viz.layout.actuator_view import actuator_view
from spheretwin.viz.layout.plots import Plots, quantity
from spheretwin.viz.quantities.error import ERROR
from spheretwin.viz.quantities.error_angle import ERROR_ANGLE
from spheretwin.viz.quantities.margin import MARGIN, MOST


def overview(plots: Plots) -> rrb.Container:
    """Actuator and currents beside the errors, what is left of the torque, states and events."""
    seen = rrb.Vertical(actuator_view(plots.view.size), panels.current_map(plots), row_shares=[3, 2])
    told = rrb.Vertical(
        plots.above_zero("error as one angle", "°", quantity(ERROR_ANGLE), least=ERROR_ANGLE.floor),
        plots.about_zero("error of each axis", "mrad", quantity(ERROR), least=ERROR.floor),
        plots.fixed(
            f"torque margin [times the commanded], 0 is saturated, {MOST:g} or more is {MOST:g}",
            quantity(MARGIN),
            low=-0.05 * MOST,
            high=1.05 * MOST,
        ),
        rrb.Horizontal(plots.states(), panels.log(), column_shares=[1, 1]),
        row_shares=[3, 3, 2, 4 if any(each.states for each in plots.view.own) else 3],
    )
    return rrb.Horizontal(seen, told, column_shares=[4, 5], name="overview")
