"""Which coils work how hard, and how near to their limit."""

from __future__ import annotations

import rerun.blueprint as rrb

from spheretwin.viz.layout import panels
from spheretwin.viz.layout.plots import Plots, quantity
from spheretwin.viz.quantities.copper_loss import COPPER_LOSS


def coils(plots: Plots) -> rrb.Container:
    """Currents over time; below, those at the cursor, and the heat of all."""
    heat = plots.above_zero("heat of all coils", "W", quantity(COPPER_LOSS), least=COPPER_LOSS.floor)
    below = rrb.Horizontal(panels.current_bars(plots), heat)
    return rrb.Vertical(panels.current_map(plots), below, row_shares=[3, 2], name="coils")
