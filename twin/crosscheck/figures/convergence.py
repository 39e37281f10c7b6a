"""Orders of convergence."""

from __future__ import annotations

from spheretwin.twin.crosscheck.part import Evidence
from spheretwin.twin.crosscheck.trajectories import Trajectories
from spheretwin.viz.figures.drawing import Drawing


def draw(evidence: Evidence) -> Drawing:
    """Orders of convergence."""
    from spheretwin.viz.figures import plots

    slopes = {
        name: plots.Slope(*measured) for name, measured in evidence.of(Trajectories).convergence.items()
    }
    figure = plots.convergence(slopes, "Order of convergence against DOP853")
    return Drawing("convergence.png", "Largest error over 5 s at five steps, with the fitted slopes.", figure)
