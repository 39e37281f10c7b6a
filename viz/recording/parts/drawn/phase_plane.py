"""The phase plane of a law with a sliding variable: how each axis falls onto s = 0 and slides along it."""

from __future__ import annotations

import numpy as np
import rerun as rr

from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import palette
from spheretwin.viz.layout.paths import PHASE_PLANE
from spheretwin.viz.recording.columns import time_index
from spheretwin.viz.recording.parts.drawn.bins import Binned, Bins
from spheretwin.viz.recording.parts.part import Part, Subject

RATE_Hz = 20.0

SLIDING = "sliding_s"

# Longer than the sides of any view of it, rad/s.
_FAR = 1e3


class PhasePlane(Part):
    """Points (s - ė, ė) of the axes, both in rad/s: with s = λe + ė (30) the first is λe, whatever λ is."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._bins = Bins(RATE_Hz, at_once=subject.live)
        self._axes_drawn = False

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record what bins the rows of a chunk have completed, where the law has the variable."""
        if all(signal.name != SLIDING for signal in rows.signals):
            return
        if not self._axes_drawn:
            _log_axes(recording)
            self._axes_drawn = True
        error_rate = rows["qdot_rad_s"] - rows["qdot_ref_rad_s"]
        points = np.concatenate([rows[SLIDING] - error_rate, error_rate], axis=1)
        self._record(recording, self._bins.add(rows["t_s"], points))

    def finish(self, recording: rr.RecordingStream, status: Status) -> None:
        """Record the last bin."""
        self._record(recording, self._bins.rest())

    def _record(self, recording: rr.RecordingStream, binned: Binned | None) -> None:
        if binned is None:
            return
        # Both coordinates of one moment: extremes of each would be a point that never was.
        x, y = binned.first[:, :3], -binned.first[:, 3:]  # a 2D view's y points down
        positions = np.stack([x, y], axis=2).reshape(-1, 2)
        columns = rr.Points2D.columns(positions=positions).partition([3] * len(x))
        recording.send_columns(PHASE_PLANE, time_index(binned.t_s), columns)


def _log_axes(recording: rr.RecordingStream) -> None:
    ends = [[[-_FAR, 0], [_FAR, 0]], [[0, -_FAR], [0, _FAR]], [[-_FAR, -_FAR], [_FAR, _FAR]]]
    colours = [palette.DESIRED_TRACE, palette.DESIRED_TRACE, palette.ASKED]
    axes = rr.LineStrips2D(ends, colors=colours, radii=rr.Radius.ui_points(0.5))
    points = rr.Points2D.from_fields(colors=palette.AXIS_COLOURS, radii=rr.Radius.ui_points(2.5))
    recording.log(PHASE_PLANE, axes, points, static=True)
