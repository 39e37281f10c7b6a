"""Phase plane of the sliding variables."""

from __future__ import annotations

import numpy as np
import rerun as rr

from spheretwin.models.telemetry.table import Table
from spheretwin.viz import theme
from spheretwin.viz.decimation import FirstRows
from spheretwin.viz.layout.view import PHASE_PLANE
from spheretwin.viz.recording.part import RecordingPart, RecordingSubject, time_index

PHASE_PLANE_RATE_Hz = 200.0

SLIDING = "sliding_s"

# Longer than the sides of any view of it, rad/s.
_FAR = 1e3


class PhasePlane(RecordingPart):
    """Points (s - ė, ė) of the axes, both in rad/s: with s = λe + ė (30) the first is λe, for any λ.

    A row is a point of its own: a bin's extremes would be a point that never was.
    """

    def __init__(self, subject: RecordingSubject) -> None:
        super().__init__(subject)
        self._firsts = FirstRows(PHASE_PLANE_RATE_Hz)
        self._axes_drawn = False

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record some of the rows, where the law has the variable."""
        if all(signal.name != SLIDING for signal in rows.signals):
            return
        if not self._axes_drawn:
            _log_axes(recording)
            self._axes_drawn = True
        places = self._firsts.first_places(rows["t_s"])
        if not len(places):
            return
        error_rate = rows["qdot_rad_s"][places] - rows["qdot_ref_rad_s"][places]
        x, y = rows[SLIDING][places] - error_rate, -error_rate  # a 2D view's y points down
        positions = np.stack([x, y], axis=2).reshape(-1, 2)
        columns = rr.Points2D.columns(positions=positions).partition([3] * len(x))
        recording.send_columns(PHASE_PLANE, time_index(rows["t_s"][places]), columns)


def _log_axes(recording: rr.RecordingStream) -> None:
    ends = [[[-_FAR, 0], [_FAR, 0]], [[0, -_FAR], [0, _FAR]], [[-_FAR, -_FAR], [_FAR, _FAR]]]
    colours = [theme.DESIRED_TRACE, theme.DESIRED_TRACE, theme.COMMAND]
    axes = rr.LineStrips2D(ends, colors=colours, radii=rr.Radius.ui_points(0.5))
    points = rr.Points2D.from_fields(colors=theme.AXIS_COLOURS, radii=rr.Radius.ui_points(2.5))
    recording.log(PHASE_PLANE, axes, points, static=True)
