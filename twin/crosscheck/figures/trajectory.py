"""A motion by given torques, and how far engine and reference part."""

from __future__ import annotations

from spheretwin.twin.crosscheck import trajectories
from spheretwin.twin.crosscheck.part import Evidence
from spheretwin.viz.figures.drawing import Drawing


def draw(evidence: Evidence) -> Drawing:
    """A motion by given torques, and how far engine and reference part."""
    from spheretwin.viz.figures import plots

    followed = evidence.of(trajectories.Trajectories)
    figure = plots.motion(
        followed.t_s,
        followed.q_rad,
        followed.difference_rad,
        trajectories.BOUND_rad,
        "MuJoCo RK4 against DOP853 on the Lagrangian, torques held over 10 ms",
    )
    return Drawing(
        "trajectory.png", "Nutation by given torques, and how far engine and reference part.", figure
    )
