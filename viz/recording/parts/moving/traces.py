"""The way of the shaft's tip over the last seconds, and the way that was asked for."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.telemetry.table import Table
from spheretwin.viz.recording.columns import strips, time_index
from spheretwin.viz.recording.parts.moving.frames import Frames
from spheretwin.viz.recording.parts.part import Part, Subject
from spheretwin.viz.scene.poses import shaft_tip
from spheretwin.viz.scene.traces import TRACES, Trace


class Traces(Part):
    """One short segment a frame; the view shows those of each trace's ages."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._frames = {trace: Frames(trace.rate_Hz) for trace in TRACES}
        self._last: dict[Trace, NDArray[np.float64]] = {}

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log what each trace looks like."""
        for trace in TRACES:
            width = rr.Radius.ui_points(trace.width)
            style = rr.LineStrips3D.from_fields(colors=[trace.colour], radii=width)
            recording.log(trace.entity, style, static=True)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the ticks that fall on a frame."""
        for trace, frames in self._frames.items():
            new = frames.of(rows)
            if np.any(new):
                self._send(recording, trace, rows["t_s"][new], rows[trace.signal][new])

    def _send(
        self, recording: rr.RecordingStream, trace: Trace, t_s: NDArray[np.float64], q: NDArray[np.float64]
    ) -> None:
        tips = shaft_tip(q, self.subject.actuator)
        before = np.concatenate([self._last.get(trace, tips[:1]), tips[:-1]])
        self._last[trace] = tips[-1:]
        segments = np.stack([before, tips], axis=1)  # (n, 2, 3)
        columns = rr.LineStrips3D.columns(strips=strips(segments))
        recording.send_columns(trace.entity, time_index(t_s), columns)
