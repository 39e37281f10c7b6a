"""A mark in every plot where a run has ended before its time."""

from __future__ import annotations

import numpy as np
import rerun as rr

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.viz import palette
from spheretwin.viz.layout.paths import ENDED
from spheretwin.viz.recording.columns import scalars, time_index

# From beyond any range of a plot to beyond its other end, in steps: a viewer draws with single precision, and
# would lose a line between two points that are far outside of a narrow range.
_HALF = np.geomspace(1e5, 1e-3, 9)
_HEIGHTS = np.concatenate([-_HALF, _HALF[::-1]])

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
    heights = np.repeat(_HEIGHTS[:, None], count, axis=1)
    times = t_s + _NEXT_S * np.arange(len(heights), dtype=np.float64)
    recording.send_columns(ENDED, time_index(times), [scalars(heights, count)])
