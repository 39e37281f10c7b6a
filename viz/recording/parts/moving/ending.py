"""Where a run failed."""

from __future__ import annotations

import numpy as np
import rerun as rr

from spheretwin.models.telemetry.status import Level, Status
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import palette
from spheretwin.viz.recording.columns import time_index
from spheretwin.viz.recording.parts.moving.frames import posed
from spheretwin.viz.recording.parts.part import Part, Subject
from spheretwin.viz.scene.marks import size_of
from spheretwin.viz.scene.paths import FAILURE, FAILURE_TEXT
from spheretwin.viz.scene.poses import shaft_tip

# A ball around the tip, and its text on top of a pole, clear of the texts of the torques.
MARK_RADIUS_m, POLE_m = 0.006, 0.1


class Ending(Part):
    """A mark at the shaft's tip from the last tick on, where that is a failure."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._t_s = 0.0
        self._q_rad = np.zeros((1, 3))

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Keep the last pose; of a run that diverged, the last that is one."""
        self._t_s = float(rows["t_s"][-1])
        poses = rows["q_rad"][posed(rows)]
        if len(poses):
            self._q_rad = poses[-1:]

    def finish(self, recording: rr.RecordingStream, status: Status) -> None:
        """Mark a failure."""
        if status.level != Level.ERROR:
            return
        tip = shaft_tip(self._q_rad, self.subject.actuator)
        top = tip + size_of(self.subject.actuator) * np.array([0.0, 0.0, POLE_m])
        mark = [
            *rr.Points3D.columns(positions=tip, colors=[palette.FAILURE], radii=[MARK_RADIUS_m]),
            *rr.LineStrips3D.columns(
                strips=np.stack([tip, top], axis=1),
                colors=[palette.FAILURE],
                radii=rr.Radius.ui_points(1.5),
            ),
        ]
        text = f"{status.replace('_', ' ')} at {self._t_s:.3f} s"
        told = rr.Points3D.columns(
            positions=top, colors=[palette.FAILURE], radii=rr.Radius.ui_points(0.0), labels=[text]
        )
        index = time_index(np.array([self._t_s]))
        recording.send_columns(FAILURE, index, mark)
        recording.send_columns(FAILURE_TEXT, index, told)
