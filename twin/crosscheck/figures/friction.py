"""Friction of a hinge: ours and MuJoCo's."""

from __future__ import annotations

from spheretwin.twin.crosscheck.bearing.runs import PUSH, Bearing, START_rad_s
from spheretwin.twin.crosscheck.friction import HingeFriction, VISCOUS_Nm_s
from spheretwin.twin.crosscheck.part import Evidence
from spheretwin.viz.figures.drawing import Drawing


def draw(evidence: Evidence) -> Drawing:
    """Friction of a hinge: ours and MuJoCo's."""
    from spheretwin.viz.figures import hinge_friction

    def drawn(bearing: Bearing) -> tuple[hinge_friction.Ramped, hinge_friction.Resting]:
        hinge, ramp, coast = bearing.hinge, bearing.ramp, bearing.coast
        level = hinge.coulomb_Nm
        rates = {way: motion.qdot_rad_s for way, motion in coast.motions.items()}
        return (
            hinge_friction.Ramped(
                ramp.torque_Nm, ramp.rates_rad_s, ramp.ideal_rad_s, level, PUSH * level, bearing.creep_rad_s
            ),
            hinge_friction.Resting(coast.t_s, rates, coast.ideal_rad_s, hinge.ideal_time_s(START_rad_s)),
        )

    bearings = evidence.of(HingeFriction).bearings
    figure = hinge_friction.hinge_friction(
        {
            f"Coulomb {name}, viscous {1e3 * VISCOUS_Nm_s:g} mN·m·s": drawn(bearing)
            for name, bearing in bearings.items()
        },
        "Friction of one hinge: our stage, and MuJoCo's friction loss and damping",
    )
    caption = (
        "Sticking, breakaway, sliding and coming to rest of hinge γ under our stage of friction and under"
        " MuJoCo's own, and under ideal friction; dots: settled under half of the level."
    )
    return Drawing("friction.png", caption, figure)
