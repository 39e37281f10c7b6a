"""A mark in every plot where a run has ended before its time."""

from __future__ import annotations

import numpy as np
import rerun as rr

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.viz import palette
from spheretwin.viz.layout.paths import ENDED
from spheretwin.viz.recording.columns import scalars, time_index

# Beyond any range of a plot, so that the line between two points crosses it.
_FAR = 1e9

_NEXT_S = 1e-9


def log_end(recording: rr.RecordingStream, t_s: float) -> None:
    """Log a vertical line, once for each series that a plot may pick."""
    count = len(ANGLES)
    style = rr.SeriesLines(
        names=["the run ends"] * count,
        colors=[palette.FAILURE] * count,
        widths=[2.0] * count,
        aggregation_policy="Off",  # the mean of both ends would be a point
    )
    recording.log(ENDED, style, static=True)
    ends = np.repeat([[-_FAR], [_FAR]], count, axis=1)
    recording.send_columns(ENDED, time_index(np.array([t_s, t_s + _NEXT_S])), [scalars(ends, count)])
