"""Runs of one condition side by side on one timeline: a path a law, under the names of their laws."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.viz import theme
from spheretwin.viz.comparison.ghosts import Line, send_lines, send_point, style_point
from spheretwin.viz.comparison.runs import LawTrajectory
from spheretwin.viz.layout.layout import blueprint
from spheretwin.viz.layout.plots import time_axis, time_range
from spheretwin.viz.layout.view import application_of
from spheretwin.viz.recording.recorder import recorded
from spheretwin.viz.recording.scene3d import send_path, style_path
from spheretwin.viz.scene.entities import TRAIL_S
from spheretwin.viz.scene.meshes import WORLD
from spheretwin.viz.scene.places import shaft_tip

DESIRED = "desired"


def write(path: Path, trajectories: Mapping[str, LawTrajectory], actuator: Actuator, name: str) -> Path:
    """Write a recording of runs side by side; returns its path.

    Parameters
    ----------
    path : Path
    trajectories : mapping of label to LawTrajectory
        At least one.
    actuator : Actuator
        Actuator whose shaft tip is drawn.
    name : str
        Name of the recording.

    Raises
    ------
    InputError, SpheretwinError
        The file cannot be written there.
    """
    application = application_of("spheretwin-trajectories", repr((name, list(trajectories))))
    with recorded(path, application, _layout(trajectories)) as recording:
        recording.send_recording_name(name)
        recording.log(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        longest = max(trajectories.values(), key=lambda trajectory: len(trajectory.t_s))
        desired = shaft_tip(longest.q_ref_rad, actuator)
        _send_tip(recording, DESIRED, longest.t_s, desired, theme.DESIRED_TRACE)
        colours = theme.law_colours([trajectory.law for trajectory in trajectories.values()])
        for label, trajectory in trajectories.items():
            _send_trajectory(recording, label, trajectory, actuator, theme.rgb(colours[trajectory.law]))
    return path


def _send_trajectory(
    recording: rr.RecordingStream,
    label: str,
    trajectory: LawTrajectory,
    actuator: Actuator,
    colour: theme.Colour,
) -> None:
    t_s, error_mrad = trajectory.t_s, 1e3 * (trajectory.q_rad - trajectory.q_ref_rad)
    _send_tip(recording, label, t_s, shaft_tip(trajectory.q_rad, actuator), colour)
    for axis, angle in enumerate(ANGLES):
        line = Line(label, error_mrad[:, axis], colour)
        send_lines(recording, f"error/{angle}/{_part(label)}", t_s, line)
    send_lines(recording, f"torque/{_part(label)}", t_s, Line(label, trajectory.torque_Nm, colour))


def _send_tip(
    recording: rr.RecordingStream, label: str, t_s: Array, tips: Array, colour: theme.Colour
) -> None:
    below = f"{WORLD}/{_part(label)}"
    style_point(recording, f"{below}/tip", label, colour)
    send_point(recording, f"{below}/tip", t_s, tips)
    style_path(recording, f"{below}/path", colour)
    send_path(recording, f"{below}/path", t_s, tips, tips[:1])


def _layout(trajectories: Mapping[str, LawTrajectory]) -> rrb.Blueprint:
    last_s, trail = (
        max(float(trajectory.t_s[-1]) for trajectory in trajectories.values()),
        time_range(TRAIL_S),
    )
    tips = rrb.Spatial3DView(
        origin=f"/{WORLD}",
        name="the shaft's tip under each law",
        overrides={f"/{WORLD}/{_part(label)}/path": trail for label in (DESIRED, *trajectories)},
    )
    plots = [
        rrb.TimeSeriesView(origin=f"/{origin}", name=name, axis_x=time_axis(last_s))
        for origin, name in (
            *((f"error/{angle}", f"error of {angle} [mrad]") for angle in ANGLES),
            ("torque", "torque of the coils, norm [N·m]"),
        )
    ]
    return blueprint(rrb.Horizontal(tips, rrb.Vertical(*plots), column_shares=[4, 5]))


def _part(label: str) -> str:
    return rr.escape_entity_path_part(label.replace(" ", "_"))
