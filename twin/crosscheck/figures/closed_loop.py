"""The same run on two plants."""

from __future__ import annotations

from spheretwin.twin.crosscheck import closed_loop
from spheretwin.twin.crosscheck.part import Evidence
from spheretwin.viz.figures.drawing import Drawing


def draw(evidence: Evidence) -> Drawing:
    """The same run on two plants."""
    from spheretwin.viz.figures import plots

    pairs = evidence.of(closed_loop.ClosedLoop).pairs
    longest = max(pairs.values(), key=lambda pair: len(pair.mujoco))
    errors = {law: (pair.mujoco["error_rad"], pair.lagrangian["error_rad"]) for law, pair in pairs.items()}
    apart = {law: plots.Bounded(pair.difference_rad, closed_loop.BOUND_rad) for law, pair in pairs.items()}
    titles = {"PD": "PD, load 0.5", "AFSM": "AFSM, load 2"}
    figure = plots.closed_loops(
        longest.mujoco["t_s"],
        {titles[law]: pair for law, pair in errors.items()},
        {titles[law]: series for law, series in apart.items()},
        ("MuJoCo", "Lagrangian"),
        "The nutation in closed loop on two plants",
    )
    return Drawing(
        "closed_loop.png", "The same run on MuJoCo and on the Lagrangian under our own RK4.", figure
    )
