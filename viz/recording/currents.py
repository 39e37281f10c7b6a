"""Currents of the coil groups: colours of the coils, bars, and maps over time.

Colours have the range of the run, which is known at its end: those of a file are recorded then. In a live
view they have the range of the current limit.
"""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import theme
from spheretwin.viz.decimation import CompletedBins, FirstRows, TimeBins
from spheretwin.viz.layout.extents import MARGIN, CurrentRanges, nice
from spheretwin.viz.layout.view import CURRENT_MAP, CURRENT_RMS
from spheretwin.viz.recording.part import RecordingPart, RecordingSubject, scalars, time_index
from spheretwin.viz.rerun_internals import ArrowComponent
from spheretwin.viz.scene.entities import FRAME_RATE_Hz, current_scale_labels
from spheretwin.viz.scene.meshes import COILS, CURRENT_SCALE

BAR_WIDTH = 0.8

LEAST_A = 0.01
"""Least range: smaller currents must not look large."""

RANGES = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
"""Ranges of colours in a decade."""

WITHIN_RANGE = 0.98
"""Share of the values that a range of colours contains; larger ones have the full colour."""


def colour_range(current_A: NDArray[np.floating], limit_A: float) -> float:
    """Return the range of the colours of some currents: at most the current limit."""
    size_A = np.abs(current_A[np.isfinite(current_A)])
    usual_A = float(np.quantile(size_A, WITHIN_RANGE)) if len(size_A) else 0.0
    return min(limit_A, nice(max(MARGIN * usual_A, LEAST_A), RANGES))


_VALUES = next(iter(rr.BarChart.columns(values=np.zeros((1, 1))))).component_descriptor()
_TEXTURE = next(
    iter(rr.Mesh3D.columns(albedo_texture_buffer=np.zeros((1, 1), np.uint8)))
).component_descriptor()


class CoilColours:
    """Colours of the coils in every frame, and the range of bars and colours.

    Parameters
    ----------
    limit_A : float
        Current limit: the greatest range.
    live : bool
        Record the colours at once, in the range of the limit.
    """

    def __init__(self, limit_A: float, *, live: bool = False) -> None:
        self._limit_A, self._live = limit_A, live
        self._frames = FirstRows(FRAME_RATE_Hz)
        self._t_s: list[Array] = []
        self._current_A: list[NDArray[np.float32]] = []

    def begin(self, recording: rr.RecordingStream) -> None:
        """State the range of a live view."""
        if self._live:
            self._state_range(recording, self._limit_A)

    def add(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Add the rows of a chunk."""
        places = self._frames.first_places(rows["t_s"])
        if not len(places):
            return
        self._t_s.append(rows["t_s"][places])
        self._current_A.append(rows["current_A"][places].astype(np.float32))  # hours wait for the end
        if self._live:
            self._send(recording, self._limit_A)

    def finish(self, recording: rr.RecordingStream) -> None:
        """Record the colours of a file, and their range."""
        if self._live or not self._t_s:
            return
        range_A = colour_range(np.concatenate(self._current_A), self._limit_A)
        self._send(recording, range_A)
        self._state_range(recording, range_A)

    def _send(self, recording: rr.RecordingStream, range_A: float) -> None:
        t_s, current_A = np.concatenate(self._t_s), np.concatenate(self._current_A)
        colours = theme.current_colours(current_A, range_A).reshape(len(t_s), -1)  # (n, 3 * groups)
        column = rr.ComponentColumn(_TEXTURE, ArrowComponent(_lists(colours)))
        recording.send_columns(COILS, time_index(t_s), [column])
        self._t_s, self._current_A = [], []

    def _state_range(self, recording: rr.RecordingStream, range_A: float) -> None:
        """Label the scale of the colours, and log bars without width that fix the scale of the bars."""
        ends = rr.BarChart(np.array([range_A, -range_A]), widths=[0.0, 0.0])
        recording.log(CURRENT_SCALE, ends, current_scale_labels(range_A, self._limit_A), static=True)


class CoilCurrents(RecordingPart):
    """Colours of the coils, and bars of the groups of every row; if rows are decimated, of every frame."""

    def __init__(self, subject: RecordingSubject) -> None:
        super().__init__(subject)
        self._frames = FirstRows(FRAME_RATE_Hz) if subject.view.decimated else None
        self._colours = CoilColours(subject.facts.current_limit_A, live=subject.live)

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log the places of the bars."""
        groups = len(self.subject.actuator.groups)
        places = np.arange(groups) - BAR_WIDTH / 2
        bars = rr.BarChart(places, abscissa=places, widths=[BAR_WIDTH] * groups, color=theme.GROUP)
        look = [batch for batch in bars.as_component_batches() if batch.component_descriptor() != _VALUES]
        recording.log(COILS, look, static=True)
        self._colours.begin(recording)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the currents of the rows of a chunk."""
        self._colours.add(recording, rows)
        t_s, current_A = rows["t_s"], rows["current_A"]
        if self._frames:
            places = self._frames.first_places(t_s)
            t_s, current_A = t_s[places], current_A[places]
        if len(t_s):
            bars = rr.ComponentColumn(_VALUES, ArrowComponent(_tensors(current_A)))
            recording.send_columns(COILS, time_index(t_s), [bars])

    def finish(self, recording: rr.RecordingStream, status: Status) -> None:
        """Record the colours of a file."""
        self._colours.finish(recording)


_TEXTURES = rr.components.ImageBufferBatch([np.zeros(1, np.uint8)]).as_arrow_array().type
_TENSOR = rr.components.TensorDataBatch(np.zeros(1, np.float16)).as_arrow_array().type


def _lists(values: NDArray[np.uint8]) -> pa.Array:
    """Arrow form of one list of bytes a row of (n, size) values; Rerun's own conversion is slow."""
    starts = values.shape[1] * np.arange(len(values) + 1, dtype=np.int32)
    return pa.ListArray.from_arrays(pa.array(starts), pa.array(values.ravel()), type=_TEXTURES)


def _tensors(values: Array) -> pa.Array:
    """Arrow form of one tensor a row of (n, size) values, in half precision: three digits of a number."""
    count, size = values.shape
    shape, names, buffer = (_TENSOR.field(i).type for i in range(3))
    flat = pa.array(values.astype(np.float16).ravel())
    children, code = [], -1
    for place in range(buffer.num_fields):
        field = buffer.field(place)
        if field.name == "F16":
            code = place
            starts = pa.array(size * np.arange(count + 1, dtype=np.int32))
            children.append(pa.ListArray.from_arrays(starts, flat, type=field.type))
        else:
            children.append(
                pa.nulls(0, field.type) if pa.types.is_null(field.type) else pa.array([], field.type)
            )
    codes, places = np.full(count, code, np.int8), np.arange(count, dtype=np.int32)
    buffers = [None, pa.py_buffer(codes), pa.py_buffer(places)]
    sizes = pa.array(np.full(count, size, np.uint64))
    return pa.StructArray.from_arrays(
        [
            pa.ListArray.from_arrays(pa.array(np.arange(count + 1, dtype=np.int32)), sizes, type=shape),
            pa.nulls(count, names),
            pa.UnionArray.from_buffers(buffer, count, buffers, children=children),
        ],
        fields=[_TENSOR.field(i) for i in range(3)],
    )


CURRENT_MAP_RATE_Hz = 12.5

# Height of a row of a map, in points of the screen: rows of 18 groups touch in a panel of some 230.
ROW_HEIGHT = 13.0


class CurrentMap:
    """Mean and root mean square of each group's current in each bin of time.

    Parameters
    ----------
    groups : int
    limit_A : float
        Current limit: the greatest range.
    live : bool
        Record every bin at once, in the range of the limit.
    """

    def __init__(self, groups: int, limit_A: float, *, live: bool = False) -> None:
        self._groups, self._limit_A, self._live = groups, limit_A, live
        self._bins = TimeBins(CURRENT_MAP_RATE_Hz, immediate=live)
        self._cells: list[tuple[Array, Array, Array]] = []
        self._begun = False

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log the names of the rows."""
        names = [f"group {group}" for group in range(self._groups)]
        style = rr.SeriesLines(names=names, widths=[ROW_HEIGHT] * len(names), aggregation_policy="Off")
        for entity in (CURRENT_MAP, CURRENT_RMS):
            recording.log(entity, style, static=True)

    def add(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Add the rows of a chunk."""
        current_A = rows["current_A"]
        self._add(self._bins.add(rows["t_s"], np.concatenate([current_A, current_A**2], axis=1)))
        if self._live:
            self._send(recording)

    def finish(self, recording: rr.RecordingStream) -> CurrentRanges:
        """Record what is left; return the ranges of the colours."""
        self._add(self._bins.flush())
        return self._send(recording)

    def _add(self, binned: CompletedBins | None) -> None:
        """Add points at the ends of bins: a viewer draws the line to a point in the colour of the point."""
        if binned is None:
            return
        t_s, mean = binned.last_s, binned.mean
        if not self._begun and t_s[0] > binned.t_s[0]:
            t_s, mean = np.append(binned.t_s[:1], t_s), np.concatenate([mean[:1], mean])
        self._begun = True
        mean_A, mean_square_A2 = np.split(mean, 2, axis=1)
        self._cells.append((t_s, mean_A, np.sqrt(mean_square_A2)))

    def _send(self, recording: rr.RecordingStream) -> CurrentRanges:
        """Record the cells so far; return the ranges of their colours."""
        ranges = CurrentRanges(self._limit_A, self._limit_A)
        if not self._cells:
            return ranges
        t_s, mean_A, rms_A = (np.concatenate(parts) for parts in zip(*self._cells, strict=True))
        self._cells = []
        if not self._live:
            ranges = CurrentRanges(*(colour_range(of, self._limit_A) for of in (mean_A, rms_A)))
        places = np.tile(np.arange(self._groups, dtype=np.float64), (len(t_s), 1))
        for entity, colours in (
            (CURRENT_MAP, theme.current_colours(mean_A, ranges.mean_A)),
            (CURRENT_RMS, theme.magnitude_colours(rms_A, ranges.rms_A)),
        ):
            packed = rr.SeriesLines.columns(colors=_packed(colours)).partition([self._groups] * len(t_s))
            recording.send_columns(entity, time_index(t_s), [scalars(places, self._groups), *packed])
        return ranges


def _packed(colours: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Colours (n, groups, 3) as Rerun packs them, all after one another."""
    red, green, blue = np.moveaxis(colours.astype(np.uint32), -1, 0)
    return ((red << 24) | (green << 16) | (blue << 8) | 255).ravel()
