"""How much of its bound each figure takes up."""

from __future__ import annotations

import numpy as np

from spheretwin.twin.crosscheck.part import Evidence
from spheretwin.viz.figures.drawing import Drawing


def draw(evidence: Evidence) -> Drawing:
    """How much of its bound each figure takes up."""
    from spheretwin.viz.figures import plots

    shares = {
        check.name: check.value / check.bound if np.isfinite(check.value) else np.inf
        for check in evidence.checks
        if check.value is not None and check.bound is not None and check.at_least is None
    }
    figure = plots.margins(shares, "How much of its bound each figure takes up")
    caption = "Value over bound; orders of convergence and breakaway torques, which have two, are below."
    return Drawing("margins.png", caption, figure)
