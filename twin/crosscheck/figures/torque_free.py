"""Drift of what a torque-free rotor keeps."""

from __future__ import annotations

from spheretwin.twin.crosscheck import free_rotor
from spheretwin.twin.crosscheck.part import Evidence
from spheretwin.viz.figures.drawing import Drawing


def draw(evidence: Evidence) -> Drawing:
    """Drift of what a torque-free rotor keeps."""
    from spheretwin.viz.figures import plots

    found = evidence.of(free_rotor.FreeRotor)
    axis = {
        "energy": "energy, relative",
        "angular momentum": "angular momentum,\nrelative",
        "attitude": "attitude, rad",
    }
    panels = {
        axis[quantity]: {
            f"{spin} rad/s": plots.Bounded(drift.values, drift.bound) for spin, drift in by_spin.items()
        }
        for quantity, by_spin in found.drifts.items()
    }
    title = f"Torque-free rotor over {free_rotor.DURATION_s:g} s, by spin rate"
    figure = plots.drifts(found.t_s, panels, title)
    caption = "Drift of energy and angular momentum, and attitude against Euler's exact solution at J1 = J2."
    return Drawing("torque_free.png", caption, figure)
