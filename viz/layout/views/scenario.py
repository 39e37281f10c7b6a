"""What exactly was run."""

from __future__ import annotations

import rerun.blueprint as rrb

from spheretwin.viz.layout.paths import SCENARIO
from spheretwin.viz.layout.plots import Plots


def scenario(plots: Plots) -> rrb.Container:
    """The resolved scenario as text."""
    text = rrb.TextDocumentView(origin=f"/{SCENARIO}", name="resolved scenario")
    return rrb.Vertical(text, name="scenario")
