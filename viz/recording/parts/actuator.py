"""The actuator in 3D: what only the eye needs, at the rate that it needs."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.telemetry.table import Table
from spheretwin.viz import palette
from spheretwin.viz.recording.columns import Index, strips, time_index
from spheretwin.viz.recording.parts.part import Part, Subject
from spheretwin.viz.scene.paths import COILS, TIP, TIP_DESIRED, WORLD
from spheretwin.viz.scene.poses import body_quaternions, shaft_tip
from spheretwin.viz.scene.still import log_static

FRAME_RATE_Hz = 60.0


class MovingActuator(Part):
    """Meshes, and of every frame the poses, the coils' colours and the traces of the shaft's tip."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._next_frame = 0
        self._last_tips: dict[str, NDArray[np.float64]] = {}

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log what keeps its shape."""
        log_static(recording, self.subject.actuator, self.subject.facts.mjcf, self.subject.facts.payload_kg)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the ticks that fall on a frame."""
        t = rows["t_s"]
        frame = np.floor(t * FRAME_RATE_Hz + 1e-6).astype(np.int64)
        new = frame >= np.concatenate([[self._next_frame], frame[:-1] + 1])
        if not np.any(new):
            return
        self._next_frame = int(frame[-1]) + 1
        index, q = time_index(t[new]), rows["q_rad"][new]
        for body, quaternion in body_quaternions(q).items():
            # Translation too in every row: a row that has only one of the two resets the other.
            pose = rr.Transform3D.columns(translation=np.zeros((len(q), 3)), quaternion=quaternion)
            recording.send_columns(f"{WORLD}/{body}", index, pose)
        recording.send_columns(COILS, index, self._coil_colours(rows["current_A"][new]))
        self._send_trace(recording, TIP, index, q)
        self._send_trace(recording, TIP_DESIRED, index, rows["q_ref_rad"][new])

    def _coil_colours(self, current_A: NDArray[np.float64]) -> rr.ComponentColumnList:
        colours = palette.current_colours(current_A, self.subject.facts.current_limit_A)  # (n, groups, 3)
        coils = np.empty((len(current_A), len(self.subject.actuator.coil_axes), 3), dtype=np.uint8)
        for side in range(2):  # both coils of a group carry its current
            coils[:, self.subject.actuator.groups[:, side]] = colours
        return rr.Mesh3D.columns(albedo_texture_buffer=coils.reshape(len(coils), -1))

    def _send_trace(
        self, recording: rr.RecordingStream, entity: str, index: Index, q: NDArray[np.float64]
    ) -> None:
        """One short segment a frame; the view shows those of the last seconds."""
        tips = shaft_tip(q, self.subject.actuator)
        before = np.concatenate([self._last_tips.get(entity, tips[:1]), tips[:-1]])
        self._last_tips[entity] = tips[-1:]
        segments = np.stack([before, tips], axis=1)  # (n, 2, 3)
        recording.send_columns(entity, index, rr.LineStrips3D.columns(strips=strips(segments)))
