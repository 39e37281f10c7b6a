"""Differences of engines and Lagrangian at random states."""

from __future__ import annotations

from spheretwin.twin.crosscheck import dynamics
from spheretwin.twin.crosscheck.part import Evidence
from spheretwin.viz.figures.drawing import Drawing


def draw(evidence: Evidence) -> Drawing:
    """Differences of engines and Lagrangian at random states."""
    from spheretwin.viz.figures import plots

    bounds = {quantity.name: quantity.bound for quantity in dynamics.QUANTITIES}
    figure = plots.spreads(
        evidence.of(dynamics.Dynamics).differences, bounds, "Engines against the Lagrangian at random states"
    )
    caption = "Relative differences at random states of all three plants; 1e-18 stands for none at all."
    return Drawing("dynamics.png", caption, figure)
