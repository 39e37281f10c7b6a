"""How the actuator is looked at in 3D."""

from __future__ import annotations

import rerun.blueprint as rrb

from spheretwin.viz.layout.paths import TIMELINE
from spheretwin.viz.scene import paths as scene
from spheretwin.viz.scene.torques import SCALE
from spheretwin.viz.scene.traces import TRACES, Trace

EYE_m, LOOKED_AT_m = (0.16, -0.16, 0.22), (0.0, 0.0, 0.02)


def eye(size: float) -> rrb.EyeControls3D:
    """Where all of an actuator of a size is seen from, and of what is drawn beside it."""
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=[size * each for each in EYE_m],
        look_target=[size * each for each in LOOKED_AT_m],
        eye_up=[0, 0, 1],
    )


def actuator_view(size: float) -> rrb.Spatial3DView:
    """View of all that moves, and of the traces of the last seconds, on the ground of the viewer's theme."""
    return rrb.Spatial3DView(
        origin=f"/{scene.WORLD}",
        name=f"actuator; {SCALE}",
        line_grid=False,
        eye_controls=eye(size),
        overrides={f"/{trace.entity}": _ages(trace) for trace in TRACES},
    )


def _ages(trace: Trace) -> rrb.VisibleTimeRanges:
    boundary = rrb.TimeRangeBoundary
    return rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=boundary.cursor_relative(seconds=-trace.oldest_s),
        end=boundary.cursor_relative(seconds=-trace.newest_s),
    )
