"""What moves on a plot and in space, in one colour: a line, and a point with its path behind it."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spheretwin.viz import palette
from spheretwin.viz.recording.columns import scalars, strips, time_index
from spheretwin.viz.recording.recorder import MOST_ROWS

Array = NDArray[np.float64]


def send_line(
    recording: rr.RecordingStream,
    entity: str,
    label: str,
    t_s: Array,
    values: Array,
    colour: palette.Colour,
    width: float = 1.5,
) -> None:
    """Send one line of a plot, (n,); of ticks that share a pixel, the lowest and the highest are drawn."""
    look = rr.SeriesLines(
        names=[label],
        colors=[colour],
        widths=[width],
        aggregation_policy=rr.components.AggregationPolicy.MinMax,
    )
    recording.log(entity, look, static=True)
    for first in range(0, len(t_s), MOST_ROWS):
        rows = slice(first, first + MOST_ROWS)
        recording.send_columns(entity, time_index(t_s[rows]), [scalars(values[rows], 1)])


def style_point(recording: rr.RecordingStream, entity: str, label: str, colour: palette.Colour) -> None:
    """Say how a point looks that is sent later."""
    thick = rr.Radius.ui_points(6.0)
    recording.log(entity, rr.Points3D.from_fields(labels=[label], colors=[colour], radii=thick), static=True)


def send_point(recording: rr.RecordingStream, entity: str, t_s: Array, positions: Array) -> None:
    """Send where a point is, (n, 3) in m."""
    recording.send_columns(entity, time_index(t_s), rr.Points3D.columns(positions=positions))


def style_path(recording: rr.RecordingStream, entity: str, colour: palette.Colour) -> None:
    """Say how a path looks that is sent later."""
    style = rr.LineStrips3D.from_fields(colors=[colour], radii=rr.Radius.ui_points(1.5))
    recording.log(entity, style, static=True)


def send_path(
    recording: rr.RecordingStream, entity: str, t_s: Array, positions: Array, before: Array
) -> None:
    """Send the path of a point as a short segment a row.

    Parameters
    ----------
    recording : RecordingStream
    entity : str
    t_s : (n,) array, s
    positions : (n, 3) array, m
    before : (1, 3) or (0, 3) array, m
        Where it was before, if it was.
    """
    starts = np.concatenate([before if len(before) else positions[:1], positions[:-1]])
    segments = strips(np.stack([starts, positions], axis=1))
    recording.send_columns(entity, time_index(t_s), rr.LineStrips3D.columns(strips=segments))
