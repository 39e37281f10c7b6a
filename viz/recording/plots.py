"""Derived quantities, and at the end of a run the layout with the ranges and titles that are due to it."""

from __future__ import annotations

from time import monotonic

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import theme
from spheretwin.viz.decimation import CompletedBins, TimeBins
from spheretwin.viz.layout.extents import ColumnSelector, ExtentTracker, plotted_signals
from spheretwin.viz.layout.layout import layout, opening_layout
from spheretwin.viz.layout.plots import quantity_style
from spheretwin.viz.layout.view import (
    CURRENT_BARS,
    CURRENT_BARS_STILL,
    CURRENT_MAP,
    ENDED,
    PHASE_PLANE,
    SUMMARY,
    derived,
)
from spheretwin.viz.quantities import ERROR_ANGLE, Aggregation, QuantityRows, quantities_of
from spheretwin.viz.recording.part import RecordingPart, RecordingSubject, scalars, strips, time_index
from spheretwin.viz.recording.status import Summary

PHASE_PLANE_RATE_Hz = 20.0

SLIDING = "sliding_s"

# Longer than the sides of any view of it, rad/s.
_FAR = 1e3


class PhasePlane(RecordingPart):
    """Points (s - ė, ė) of the axes, both in rad/s: with s = λe + ė (30) the first is λe, for any λ."""

    def __init__(self, subject: RecordingSubject) -> None:
        super().__init__(subject)
        self._bins = TimeBins(PHASE_PLANE_RATE_Hz, immediate=subject.live)
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
        self._record(recording, self._bins.flush())

    def _record(self, recording: rr.RecordingStream, binned: CompletedBins | None) -> None:
        if binned is None:
            return
        # Both coordinates of one moment: extremes of each would be a point that never was.
        x, y = binned.first[:, :3], -binned.first[:, 3:]  # a 2D view's y points down
        positions = np.stack([x, y], axis=2).reshape(-1, 2)
        columns = rr.Points2D.columns(positions=positions).partition([3] * len(x))
        recording.send_columns(PHASE_PLANE, time_index(binned.t_s), columns)


def _log_axes(recording: rr.RecordingStream) -> None:
    ends = [[[-_FAR, 0], [_FAR, 0]], [[0, -_FAR], [0, _FAR]], [[-_FAR, -_FAR], [_FAR, _FAR]]]
    colours = [theme.DESIRED_TRACE, theme.DESIRED_TRACE, theme.COMMAND]
    axes = rr.LineStrips2D(ends, colors=colours, radii=rr.Radius.ui_points(0.5))
    points = rr.Points2D.from_fields(colors=theme.AXIS_COLOURS, radii=rr.Radius.ui_points(2.5))
    recording.log(PHASE_PLANE, axes, points, static=True)


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
        colors=[theme.FAILURE] * count,
        widths=[2.0] * count,
        aggregation_policy="Off",  # the mean of both ends would be a point
    )
    recording.log(ENDED, style, static=True)
    heights = np.repeat(_HEIGHTS[:, None], count, axis=1)
    times = t_s + _NEXT_S * np.arange(len(heights), dtype=np.float64)
    recording.send_columns(ENDED, time_index(times), [scalars(heights, count)])


# A bin leaves one row or two: no more than 50 a second.
QUANTITY_RATE_Hz = 25.0

# A file has a layout before the one of its end from then on, in s of the clock: it takes some 100 kB.
OPENED_AFTER_s = 2.0

# After these statuses the planned time has been run.
_AS_PLANNED = (Status.COMPLETED, Status.RUNNING)


class Quantities(RecordingPart):
    """Derived quantities, aggregated in bins of time."""

    def __init__(self, subject: RecordingSubject) -> None:
        super().__init__(subject)
        self._quantities = quantities_of({signal.name for signal in subject.signals})
        self._plotted_signals = plotted_signals(subject.signals)
        self._column_selector = ColumnSelector(self._plotted_signals)
        self._extent_tracker = ExtentTracker(
            {**{quantity.name: quantity.size for quantity in self._quantities}, **self._plotted_signals}
        )
        averaged = [
            quantity.aggregation is Aggregation.MEAN
            for quantity in self._quantities
            for _ in range(quantity.size)
        ]
        self._averaged = np.array(averaged + [False] * sum(self._plotted_signals.values()))
        self._bins = TimeBins(QUANTITY_RATE_Hz, immediate=subject.live)
        self._summary = Summary(subject.facts)
        self._before: Table | None = None
        self._begun_s: float | None = None  # clock at the first rows: all is compiled then
        self._opened = False

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log the styles of the quantities and, in a live view, the facts of the run."""
        for quantity in self._quantities:
            recording.log(derived(quantity.name), quantity_style(quantity), static=True)
        if self.subject.live:
            _log_summary(recording, self._summary.running())

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record what bins the rows of a chunk have completed."""
        self._open(recording)
        facts = self.subject.facts
        given = QuantityRows(
            rows, self._before or rows.rows(0, 1), self.subject.actuator, facts.current_limit_A
        )
        with np.errstate(all="ignore"):  # of a run that diverged, the last rows may hold no numbers
            values = {quantity.name: quantity.values(given) for quantity in self._quantities}
        self._before = Table(rows.signals, rows.values[-1:].copy())
        self._summary.add(rows, values[ERROR_ANGLE.name][:, 0])
        columns = np.concatenate([*values.values(), self._column_selector.of(rows)], axis=1)
        self._record(recording, self._bins.add(rows["t_s"], columns))

    def finish(self, recording: rr.RecordingStream, status: Status) -> None:
        """Record the last bin, and lay the recording out for what the run has shown."""
        self._record(recording, self._bins.flush())
        _log_summary(recording, self._summary.ended(status))
        last_s = self._summary.last_s
        ended_s = None if status in _AS_PLANNED else last_s
        if ended_s is not None:
            log_end(recording, ended_s)
        recording.send_blueprint(layout(self.subject.view, self._extent_tracker.extents(ended_s)))

    def _open(self, recording: rr.RecordingStream) -> None:
        """Send a layout in case the process is killed; most runs end before that is necessary."""
        self._begun_s = self._begun_s or monotonic()
        if self._opened or self.subject.live or monotonic() - self._begun_s < OPENED_AFTER_s:
            return
        self._opened = True
        _log_summary(recording, self._summary.running())
        recording.send_blueprint(opening_layout(self.subject.view))

    def _record(self, recording: rr.RecordingStream, binned: CompletedBins | None) -> None:
        if binned is None:
            return
        low, high = (np.where(self._averaged, binned.mean, bound) for bound in (binned.low, binned.high))
        self._extent_tracker.add(binned.t_s, low, high)
        t_s, both = binned.pairs()
        columns = {
            Aggregation.BOTH: (time_index(t_s), both),
            Aggregation.LEAST: (time_index(binned.t_s), binned.low),
            Aggregation.GREATEST: (time_index(binned.t_s), binned.high),
            Aggregation.MEAN: (time_index(binned.t_s), binned.mean),
        }
        first = 0
        for quantity in self._quantities:
            index, values = columns[quantity.aggregation]
            block = np.ascontiguousarray(values[:, first : first + quantity.size])
            recording.send_columns(derived(quantity.name), index, [scalars(block, quantity.size)])
            first += quantity.size


def _log_summary(recording: rr.RecordingStream, text: str) -> None:
    recording.log(SUMMARY, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)


Array = NDArray[np.float64]

CURRENT_MAP_RATE_Hz = 12.5

# Height of a row of the map, in points of the screen: rows of 18 groups touch in a panel of some 230 of them.
ROW_HEIGHT = 12.0

# The bars' panel: as wide as this, as high as 1 between the limits.
WIDTH = 2.0


class Currents(RecordingPart):
    """Current of the largest magnitude of each group in each bin of time."""

    def __init__(self, subject: RecordingSubject) -> None:
        super().__init__(subject)
        self._groups = len(subject.actuator.groups)
        self._bins = TimeBins(CURRENT_MAP_RATE_Hz, immediate=subject.live)

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log the names of the rows, the limits and the numbers of the bars."""
        names = [f"group {group}" for group in range(self._groups)]
        widths = [ROW_HEIGHT] * self._groups
        recording.log(CURRENT_MAP, rr.SeriesLines(names=names, widths=widths), static=True)
        limit_A = self.subject.facts.current_limit_A
        ends = [[[0.0, y], [WIDTH, y]] for y in (-0.5, 0.0, 0.5)]
        lines = rr.LineStrips2D(ends, colors=[theme.DESIRED_TRACE] * 3, radii=rr.Radius.ui_points(0.5))
        places = [[-0.05, -0.5], [-0.05, 0.5], *([x, 0.56] for x in self._places())]
        labels = [f"+{limit_A:g} A", f"-{limit_A:g} A", *map(str, range(self._groups))]
        captions = rr.Points2D(places, labels=labels, show_labels=True, radii=0.0, colors=[theme.PLAIN])
        recording.log(CURRENT_BARS_STILL, lines, captions, static=True)
        bars = rr.LineStrips2D.from_fields(radii=0.3 * WIDTH / self._groups)
        recording.log(CURRENT_BARS, bars, static=True)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record what bins the rows of a chunk have completed."""
        self._record(recording, self._bins.add(rows["t_s"], rows["current_A"]))

    def finish(self, recording: rr.RecordingStream, status: Status) -> None:
        """Record the last bin."""
        self._record(recording, self._bins.flush())

    def _record(self, recording: rr.RecordingStream, binned: CompletedBins | None) -> None:
        if binned is None:
            return
        current_A, index = binned.extremes(), time_index(binned.t_s)
        limit_A = self.subject.facts.current_limit_A
        colours = _packed(theme.current_colours(current_A, limit_A))
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
        ends = np.zeros((*share.shape, 2, 2))
        ends[..., 0] = self._places()[:, None]
        ends[..., 1, 1] = -0.5 * share
        return strips(ends.reshape(-1, 2, 2))


def _packed(colours: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Colours (n, groups, 3) as Rerun packs them, all after one another."""
    red, green, blue = np.moveaxis(colours.astype(np.uint32), -1, 0)
    return ((red << 24) | (green << 16) | (blue << 8) | 255).ravel()
