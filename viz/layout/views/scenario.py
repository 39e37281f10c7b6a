"""What exactly was run."""

from __future__ import annotations

import rerun.blueprint as rrb

from spheretwin.viz.layout.paths import SCENARIO
from spheretwin.viz.layout.plots import Plots


def scenario(plots: Plots) -> rrb.View:
    """The resolved scenario as text."""
    return rrb.TextDocumentView(origin=f"/{SCENARIO}", name="scenario")
