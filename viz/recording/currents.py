"""Currents of the coil groups: colours of the coils, bars, and a map over time."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import theme
from spheretwin.viz.decimation import CompletedBins, FirstRows, TimeBins
from spheretwin.viz.layout.view import CURRENT_LIMITS, CURRENT_MAP, CURRENT_VARIATION, VARIATION_LANE
from spheretwin.viz.recording.part import RecordingPart, RecordingSubject, scalars, time_index
from spheretwin.viz.rerun_internals import ArrowComponent
from spheretwin.viz.scene.entities import FRAME_RATE_Hz
from spheretwin.viz.scene.meshes import COILS

Array = NDArray[np.float64]

BAR_WIDTH = 0.8

_VALUES = next(iter(rr.BarChart.columns(values=np.zeros((1, 1))))).component_descriptor()
_TEXTURE = next(
    iter(rr.Mesh3D.columns(albedo_texture_buffer=np.zeros((1, 1), np.uint8)))
).component_descriptor()


class CoilCurrents(RecordingPart):
    """Colours of the coils and bars of the groups, of every row; if rows are decimated, of every frame."""

    def __init__(self, subject: RecordingSubject) -> None:
        super().__init__(subject)
        self._frames = FirstRows(FRAME_RATE_Hz) if subject.view.decimated else None

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log the places of the bars, and bars without width that fix the scale at the limit."""
        limit_A, groups = self.subject.facts.current_limit_A, len(self.subject.actuator.groups)
        places = np.arange(groups) - BAR_WIDTH / 2
        bars = rr.BarChart(places, abscissa=places, widths=[BAR_WIDTH] * groups, color=theme.GROUP)
        look = [batch for batch in bars.as_component_batches() if batch.component_descriptor() != _VALUES]
        recording.log(COILS, look, static=True)
        limits = rr.BarChart(np.array([limit_A, -limit_A]), widths=[0.0, 0.0])
        recording.log(CURRENT_LIMITS, limits, static=True)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the currents of the rows of a chunk."""
        t_s, current_A = rows["t_s"], rows["current_A"]
        if self._frames:
            places = self._frames.first_places(t_s)
            t_s, current_A = t_s[places], current_A[places]
        if not len(t_s):
            return
        colours = theme.current_colours(current_A, self.subject.facts.current_limit_A)  # (n, groups, 3)
        columns = [
            rr.ComponentColumn(_TEXTURE, ArrowComponent(_lists(colours.reshape(len(colours), -1)))),
            rr.ComponentColumn(_VALUES, ArrowComponent(_tensors(current_A))),
        ]
        recording.send_columns(COILS, time_index(t_s), columns)


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

# Heights of a row of the map and of the lane, in points of the screen: rows of 18 groups touch in a panel of
# some 230 of them.
ROW_HEIGHT = 12.0


class CurrentMap(RecordingPart):
    """Mean current of each group in each bin of time, and how much the currents vary within it."""

    def __init__(self, subject: RecordingSubject) -> None:
        super().__init__(subject)
        self._groups = len(subject.actuator.groups)
        self._bins = TimeBins(CURRENT_MAP_RATE_Hz, immediate=subject.live)

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log the names of the rows."""
        for entity, names in (
            (CURRENT_MAP, [f"group {group}" for group in range(self._groups)]),
            (CURRENT_VARIATION, ["standard deviation within a cell, RMS of all groups"]),
        ):
            style = rr.SeriesLines(names=names, widths=[ROW_HEIGHT] * len(names), aggregation_policy="Off")
            recording.log(entity, style, static=True)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record what bins the rows of a chunk have completed."""
        current_A = rows["current_A"]
        self._record(
            recording, self._bins.add(rows["t_s"], np.concatenate([current_A, current_A**2], axis=1))
        )

    def finish(self, recording: rr.RecordingStream, status: Status) -> None:
        """Record the last bin, up to its end."""
        binned = self._bins.flush()
        self._record(recording, binned)
        if binned and binned.last_s[-1] > binned.t_s[-1]:
            end = CompletedBins(*(column[-1:] for column in binned))
            self._record(recording, end._replace(t_s=end.last_s))

    def _record(self, recording: rr.RecordingStream, binned: CompletedBins | None) -> None:
        if binned is None:
            return
        mean_A, mean_square_A2 = np.split(binned.mean, 2, axis=1)
        variance_A2 = np.maximum(mean_square_A2 - mean_A**2, 0.0)
        deviation_A = np.sqrt(np.mean(variance_A2, axis=1, keepdims=True))
        limit_A, index = self.subject.facts.current_limit_A, time_index(binned.t_s)
        places = np.arange(self._groups, dtype=np.float64)
        _send_row(recording, CURRENT_MAP, index, places, theme.current_colours(mean_A, limit_A))
        lane = places[-1:] + VARIATION_LANE
        _send_row(recording, CURRENT_VARIATION, index, lane, theme.variation_colours(deviation_A, limit_A))


def _send_row(
    recording: rr.RecordingStream,
    entity: str,
    index: list[rr.TimeColumn],
    places: Array,
    colours: NDArray[np.uint8],
) -> None:
    """Send the colours (n, lines, 3) of lines at constant places."""
    count, lines = colours.shape[:2]
    packed = rr.SeriesLines.columns(colors=_packed(colours)).partition([lines] * count)
    recording.send_columns(entity, index, [scalars(np.tile(places, (count, 1)), lines), *packed])


def _packed(colours: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Colours (n, groups, 3) as Rerun packs them, all after one another."""
    red, green, blue = np.moveaxis(colours.astype(np.uint32), -1, 0)
    return ((red << 24) | (green << 16) | (blue << 8) | 255).ravel()
