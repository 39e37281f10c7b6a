"""How the actuator is looked at in 3D."""

from __future__ import annotations

import rerun.blueprint as rrb

from spheretwin.viz import palette
from spheretwin.viz.layout.paths import TIMELINE
from spheretwin.viz.scene import paths as scene

TRAIL_S = 2.0


def actuator_view() -> rrb.Spatial3DView:
    """View of all that moves, and of the traces of the last seconds."""
    boundary = rrb.TimeRangeBoundary

    def trail(seconds: float) -> rrb.VisibleTimeRanges:
        return rrb.VisibleTimeRanges(
            timeline=TIMELINE,
            start=boundary.cursor_relative(seconds=-seconds),
            end=boundary.cursor_relative(),
        )

    return rrb.Spatial3DView(
        origin=f"/{scene.WORLD}",
        name="actuator",
        background=list(palette.BACKGROUND),
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=[0.13, -0.13, 0.20],
            look_target=[0, 0, 0.025],
            eye_up=[0, 0, 1],
        ),
        overrides={f"/{scene.TIP}": trail(TRAIL_S), f"/{scene.TIP_DESIRED}": trail(TRAIL_S)},
    )
