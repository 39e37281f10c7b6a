"""How the actuator is looked at in 3D."""

from __future__ import annotations

import rerun.blueprint as rrb

from spheretwin.viz.layout.paths import TIMELINE
from spheretwin.viz.scene import paths as scene
from spheretwin.viz.scene.torques import SCALE
from spheretwin.viz.scene.traces import TRACES, Trace


def actuator_view() -> rrb.Spatial3DView:
    """View of all that moves, and of the traces of the last seconds, on the ground of the viewer's theme."""
    return rrb.Spatial3DView(
        origin=f"/{scene.WORLD}",
        name=f"actuator; {SCALE}",
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=[0.16, -0.16, 0.22],
            look_target=[0, 0, 0.02],
            eye_up=[0, 0, 1],
        ),
        overrides={f"/{trace.entity}": _ages(trace) for trace in TRACES},
    )


def _ages(trace: Trace) -> rrb.VisibleTimeRanges:
    boundary = rrb.TimeRangeBoundary
    return rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=boundary.cursor_relative(seconds=-trace.oldest_s),
        end=boundary.cursor_relative(seconds=-trace.newest_s),
    )
