"""The actuator itself: where its bodies are, and the current in each coil."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.telemetry.table import Table
from spheretwin.viz import palette
from spheretwin.viz.recording.columns import time_index
from spheretwin.viz.recording.parts.moving.frames import Frames
from spheretwin.viz.recording.parts.part import Part, Subject
from spheretwin.viz.scene.paths import COILS, WORLD
from spheretwin.viz.scene.poses import body_quaternions
from spheretwin.viz.scene.still import log_static


class MovingActuator(Part):
    """Meshes, and of every frame the poses and the coils' colours."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._frames = Frames()

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log what keeps its shape."""
        log_static(recording, self.subject.actuator, self.subject.facts)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the ticks that fall on a frame."""
        new = self._frames.of(rows)
        if not np.any(new):
            return
        index = time_index(rows["t_s"][new])
        for body, quaternion in body_quaternions(rows["q_rad"][new]).items():
            recording.send_columns(f"{WORLD}/{body}", index, rr.Transform3D.columns(quaternion=quaternion))
        recording.send_columns(COILS, index, self._coil_colours(rows["current_A"][new]))

    def _coil_colours(self, current_A: NDArray[np.float64]) -> rr.ComponentColumnList:
        colours = palette.current_colours(current_A, self.subject.facts.current_limit_A)  # (n, groups, 3)
        coils = np.empty((len(current_A), len(self.subject.actuator.coil_axes), 3), dtype=np.uint8)
        for side in range(2):  # both coils of a group carry its current
            coils[:, self.subject.actuator.groups[:, side]] = colours
        return rr.Mesh3D.columns(albedo_texture_buffer=coils.reshape(len(coils), -1))
