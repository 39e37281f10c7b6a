"""Currents as colours over time, and as bars at the cursor."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import palette
from spheretwin.viz.layout.paths import CURRENT_BARS, CURRENT_BARS_STILL, CURRENT_MAP
from spheretwin.viz.recording.columns import scalars, time_index
from spheretwin.viz.recording.parts.drawn.bins import Binned, Bins
from spheretwin.viz.recording.parts.part import Part, Subject

Array = NDArray[np.float64]

RATE_Hz = 12.5

# Of a row of the map, in points of the screen: rows of 18 groups touch in a panel of some 230 of them.
ROW_HEIGHT = 12.0

# The bars' panel: as wide as this, as high as 1 between the limits.
WIDTH = 2.0


class Currents(Part):
    """Of each bin of time each group's current of the largest magnitude."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._groups = len(subject.actuator.groups)
        self._bins = Bins(RATE_Hz, at_once=subject.live)

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log the names of the rows, the limits and the numbers of the bars."""
        names = [f"group {group}" for group in range(self._groups)]
        widths = [ROW_HEIGHT] * self._groups
        recording.log(CURRENT_MAP, rr.SeriesLines(names=names, widths=widths), static=True)
        limit_A = self.subject.facts.current_limit_A
        ends = [[[0.0, y], [WIDTH, y]] for y in (-0.5, 0.0, 0.5)]
        lines = rr.LineStrips2D(ends, colors=[palette.DESIRED_TRACE] * 3, radii=rr.Radius.ui_points(0.5))
        places = [[-0.05, -0.5], [-0.05, 0.5], *([x, 0.56] for x in self._places())]
        labels = [f"+{limit_A:g} A", f"-{limit_A:g} A", *map(str, range(self._groups))]
        told = rr.Points2D(places, labels=labels, show_labels=True, radii=0.0, colors=[palette.PLAIN])
        recording.log(CURRENT_BARS_STILL, lines, told, static=True)
        bars = rr.LineStrips2D.from_fields(radii=0.3 * WIDTH / self._groups)
        recording.log(CURRENT_BARS, bars, static=True)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record what bins the rows of a chunk have completed."""
        self._record(recording, self._bins.add(rows["t_s"], rows["current_A"]))

    def finish(self, recording: rr.RecordingStream, status: Status) -> None:
        """Record the last bin."""
        self._record(recording, self._bins.rest())

    def _record(self, recording: rr.RecordingStream, binned: Binned | None) -> None:
        if binned is None:
            return
        current_A, index = binned.extremes(), time_index(binned.t_s)
        limit_A = self.subject.facts.current_limit_A
        colours = _packed(palette.current_colours(current_A, limit_A))
        count = [self._groups] * len(current_A)
        rows = np.tile(np.arange(self._groups, dtype=np.float64), (len(current_A), 1))
        lines = rr.SeriesLines.columns(colors=colours).partition(count)
        recording.send_columns(CURRENT_MAP, index, [scalars(rows, self._groups), *lines])
        bars = rr.LineStrips2D.columns(strips=self._bars(current_A / limit_A), colors=colours)
        recording.send_columns(CURRENT_BARS, index, bars.partition(count))

    def _places(self) -> Array:
        return (np.arange(self._groups) + 0.5) * WIDTH / self._groups

    def _bars(self, share: Array) -> pa.Array:
        """A bar for each current, up from the middle for a positive one: a 2D view's y points down."""
        ends = np.zeros((*share.shape, 2, 2), dtype=np.float32)
        ends[..., 0] = self._places()[:, None]
        ends[..., 1, 1] = -0.5 * share
        kind = rr.components.LineStrip2DBatch([]).as_arrow_array().type
        points = pa.FixedSizeListArray.from_arrays(pa.array(ends.ravel()), type=kind.value_type)
        starts = pa.array(2 * np.arange(share.size + 1, dtype=np.int32))
        return pa.ListArray.from_arrays(starts, points, type=kind)


def _packed(colours: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Colours (n, groups, 3) as Rerun packs them, all after one another."""
    red, green, blue = np.moveaxis(colours.astype(np.uint32), -1, 0)
    return ((red << 24) | (green << 16) | (blue << 8) | 255).ravel()
