"""Which coils work how hard, and how near to their limit."""

from __future__ import annotations

import rerun.blueprint as rrb

from spheretwin.viz.layout import panels
from spheretwin.viz.layout.plots import Plots, quantity, signal
from spheretwin.viz.quantities.margin import MARGIN, MOST


def coils(plots: Plots) -> rrb.Container:
    """Currents over time and at the cursor, beside the margin and their spread."""
    limit_A = plots.view.current_limit_A
    left = rrb.Vertical(panels.current_map(plots), panels.current_bars(plots), row_shares=[3, 2])
    right = rrb.Vertical(
        plots.fixed(
            f"torque margin [times the commanded], {MOST:g} or more is {MOST:g}",
            quantity(MARGIN),
            low=-0.05 * MOST,
            high=1.05 * MOST,
        ),
        plots.fixed(
            f"spread of the currents [A], limit {limit_A:g}",
            signal("current_A"),
            low=-1.05 * limit_A,
            high=1.05 * limit_A,
        ),
    )
    return rrb.Horizontal(left, right, column_shares=[5, 4], name="coils")
