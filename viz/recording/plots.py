"""Plotted data besides the telemetry: derived quantities, envelopes, markers, ranges, phase plane."""

from __future__ import annotations

from collections.abc import Mapping
from time import monotonic

import numpy as np
import rerun as rr

from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import theme
from spheretwin.viz.decimation import CompletedBins, FirstRows, TimeBins
from spheretwin.viz.layout.extents import ExtentTracker, plotted_signals, selected_columns
from spheretwin.viz.layout.layout import layout, marked_lines, opening_layout
from spheretwin.viz.layout.styles import (
    as_struct,
    mark_style,
    quantity_style,
    signal_style,
)
from spheretwin.viz.layout.view import (
    DERIVED,
    ENDED,
    ENVELOPE,
    ONSETS,
    PHASE_PLANE,
    STYLES,
    SUMMARY,
    VALUES,
    View,
    component,
)
from spheretwin.viz.quantities import ERROR_ANGLE, QuantityRows, quantities_of
from spheretwin.viz.recording.currents import CurrentMap
from spheretwin.viz.recording.part import (
    RecordingPart,
    RecordingSubject,
    log_markdown,
    scalars,
    struct_component,
    time_index,
    vectors,
)
from spheretwin.viz.recording.summary import Summary

# From beyond any range of a plot to beyond its other end, in steps: a viewer draws with single precision, and
# would lose a line between two points that are far outside of a narrow range.
_HALF = np.geomspace(1e5, 1e-3, 9)
_HEIGHTS = np.concatenate([-_HALF, _HALF[::-1]])

_NEXT_S = 1e-9


MOST_ONSETS = 8
"""Faults whose start is drawn."""


def log_times(recording: rr.RecordingStream, summary: Summary, ended_s: float | None) -> bool:
    """Log vertical lines at the early end of a run and the first faults; return True for faults."""
    if ended_s is not None:
        _log_vertical(recording, ENDED, ended_s, "the run ends", theme.FAILURE)
    onsets = summary.fault_onsets()[:MOST_ONSETS]
    for place, (t_s, text) in enumerate(onsets):
        _log_vertical(recording, f"{ONSETS}/{place}", t_s, text, theme.WARNING)
    return bool(onsets)


def _log_vertical(
    recording: rr.RecordingStream, entity: str, t_s: float, name: str, colour: theme.Colour
) -> None:
    """Log a vertical line, once for each series that a plot may pick."""
    count = len(ANGLES)
    style = rr.SeriesLines(
        names=[name] * count,
        colors=[colour] * count,
        widths=[2.0] * count,
        aggregation_policy="Off",  # the mean of both ends would be a point
    )
    recording.log(entity, style, static=True)
    heights = np.repeat(_HEIGHTS[:, None], count, axis=1)
    times = t_s + _NEXT_S * np.arange(len(heights), dtype=np.float64)
    recording.send_columns(entity, time_index(times), [scalars(heights, count)])


ENVELOPE_RATE_Hz = 25.0
"""Bins a second of envelopes, and of the ranges of all plots."""

MARKS_OF_A_LINE = 16
"""Markers on each line over the planned time."""

# A file has a layout before the one of its end from then on, in s of the clock: it takes some 100 kB.
OPENED_AFTER_s = 2.0

# After these statuses the planned time has been run.
_AS_PLANNED = (Status.COMPLETED, Status.RUNNING)


class PlottedColumns:
    """Columns that the plots of a run show: derived quantities, then signals.

    Parameters
    ----------
    signals : tuple of Signal
        Signals of the run.

    Attributes
    ----------
    quantities : list of Quantity
        Derived quantities.
    signals : dict
        Plotted signals, with the entries of each.
    styles : dict
        Style of the lines of each column.
    sizes : dict
        Entries of each column.
    places : dict
        Entries of each column among those of all.
    """

    def __init__(self, signals: tuple[Signal, ...]) -> None:
        self.quantities = quantities_of({signal.name for signal in signals})
        self.signals = plotted_signals(signals)
        self.styles = {quantity.name: quantity_style(quantity) for quantity in self.quantities}
        self.styles |= {
            signal.name: signal_style(signal) for signal in signals if signal.name in self.signals
        }
        self.sizes = {**{quantity.name: quantity.size for quantity in self.quantities}, **self.signals}
        ends = np.cumsum(list(self.sizes.values())).tolist()
        self.places = {
            name: slice(end - self.sizes[name], end) for name, end in zip(self.sizes, ends, strict=True)
        }


class PlotData(RecordingPart):
    """Derived quantities of every row, or envelopes of all plotted lines; markers, ranges and titles."""

    def __init__(self, subject: RecordingSubject) -> None:
        super().__init__(subject)
        self._columns = PlottedColumns(subject.signals)
        self._extent_tracker = ExtentTracker(self._columns.sizes)
        self._bins = TimeBins(ENVELOPE_RATE_Hz, immediate=subject.live)
        self._marks = Marks(subject.view, self._columns)
        groups, limit_A = len(subject.actuator.groups), subject.facts.current_limit_A
        self._current_map = CurrentMap(groups, limit_A, live=subject.live)
        self._summary = Summary(subject.facts)
        self._before: Table | None = None
        self._begun_s: float | None = None  # clock at the first rows: all is compiled then
        self._opened = False

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log the styles of lines and markers and, in a live view, the facts of the run."""
        self._marks.begin(recording)
        self._current_map.begin(recording)
        if self.subject.view.decimated:
            envelopes = {name: style.of_envelope() for name, style in self._columns.styles.items()}
            _log_styles(recording, ENVELOPE, envelopes)
        else:
            names = [quantity.name for quantity in self._columns.quantities]
            _log_styles(recording, DERIVED, {name: self._columns.styles[name].lines() for name in names})
        if self.subject.live:
            log_markdown(recording, SUMMARY, self._summary.running())

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the derived quantities of the rows of a chunk, or what bins they have completed."""
        self._open(recording)
        facts = self.subject.facts
        given = QuantityRows(
            rows, self._before or rows.rows(0, 1), self.subject.actuator, facts.current_limit_A
        )
        with np.errstate(all="ignore"):  # of a run that diverged, the last rows may hold no numbers
            values = {quantity.name: quantity.values(given) for quantity in self._columns.quantities}
        self._before = Table(rows.signals, rows.values[-1:].copy())
        self._summary.add(rows, values[ERROR_ANGLE.name][:, 0])
        if not self.subject.view.decimated:
            _send(recording, DERIVED, rows["t_s"], values)
        columns = np.concatenate([*values.values(), *selected_columns(rows, self._columns.signals)], axis=1)
        self._record(recording, self._bins.add(rows["t_s"], columns))
        self._marks.add(recording, rows["t_s"], columns)
        self._current_map.add(recording, rows)

    def finish(self, recording: rr.RecordingStream, status: Status) -> None:
        """Record the last bin, and lay the recording out for what the run has shown."""
        self._marks.send(recording)
        binned = self._bins.flush()
        self._record(recording, binned)
        if binned and binned.last_s[-1] > binned.t_s[-1] and self.subject.view.decimated:
            end = CompletedBins(*(column[-1:] for column in binned))
            self._send_envelope(recording, end._replace(t_s=end.last_s))
        log_markdown(recording, SUMMARY, self._summary.ended(status))
        ended_s = None if status in _AS_PLANNED else self._summary.last_s
        has_faults = log_times(recording, self._summary, ended_s)
        currents = self._current_map.finish(recording)
        extents = self._extent_tracker.extents(ended_s, currents, has_faults=has_faults)
        recording.send_blueprint(layout(self.subject.view, extents))

    def _open(self, recording: rr.RecordingStream) -> None:
        """Send a layout in case the process is killed; most runs end before that is necessary."""
        self._begun_s = self._begun_s or monotonic()
        if self._opened or self.subject.live or monotonic() - self._begun_s < OPENED_AFTER_s:
            return
        self._opened = True
        log_markdown(recording, SUMMARY, self._summary.running())
        recording.send_blueprint(opening_layout(self.subject.view))

    def _record(self, recording: rr.RecordingStream, binned: CompletedBins | None) -> None:
        if binned is None:
            return
        self._extent_tracker.add(binned.t_s, binned.low, binned.high)
        if self.subject.view.decimated:
            self._send_envelope(recording, binned)

    def _send_envelope(self, recording: rr.RecordingStream, binned: CompletedBins) -> None:
        blocks = binned.low, binned.mean, binned.high
        values = {
            name: np.concatenate([block[:, place] for block in blocks], axis=1)
            for name, place in self._columns.places.items()
        }
        _send(recording, ENVELOPE, binned.t_s, values)


class Marks:
    """Markers on lines that share a plot: one line of three has one at a time, so that they do not coincide.

    Parameters
    ----------
    view : View
        Properties of the run.
    columns : PlottedColumns
        Columns of the lines, with their styles.
    """

    def __init__(self, view: View, columns: PlottedColumns) -> None:
        self._lines, self._styles, self._places = marked_lines(view), columns.styles, columns.places
        self._rate_Hz = 3 * MARKS_OF_A_LINE / view.shown_s
        self._firsts = FirstRows(self._rate_Hz)
        self._live = view.live
        self._t_s: list[Array] = []
        self._values: list[Array] = []

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log the styles of the markers."""
        for names, entity in self._lines.items():
            recording.log(entity, mark_style([self._styles[name] for name in names]), static=True)

    def add(self, recording: rr.RecordingStream, t_s: Array, columns: Array) -> None:
        """Add the rows of a chunk."""
        rows = self._firsts.first_places(t_s)
        self._t_s.append(t_s[rows])
        self._values.append(columns[rows])
        # Each entity takes some bytes every time: a file has its markers at the end.
        if self._live and sum(map(len, self._t_s)) >= 3:
            self.send(recording)

    def send(self, recording: rr.RecordingStream) -> None:
        """Send the markers of the rows so far."""
        t_s = np.concatenate([np.empty(0), *self._t_s])
        if not len(t_s):
            return
        columns = np.concatenate(self._values)
        self._t_s, self._values = [], []
        turn = np.round(t_s * self._rate_Hz).astype(np.int64)
        for names, entity in self._lines.items():
            values = np.concatenate([columns[:, self._places[name]] for name in names], axis=1)
            # Entries of one line, and lines of one hinge, have their markers at other times.
            line, entry = np.divmod(np.arange(values.shape[1]), max(1, values.shape[1] // len(names)))
            shown = (turn[:, None] + line + entry) % 3 == 0
            marks = np.where(shown, values, np.nan)
            recording.send_columns(entity, time_index(t_s), [scalars(marks, marks.shape[1])])


def _send(recording: rr.RecordingStream, entity: str, t_s: Array, values: Mapping[str, Array]) -> None:
    """Send values as a struct with a field for each name, in single precision: a plot shows no more."""
    with np.errstate(over="ignore", invalid="ignore"):  # a run that diverged has larger numbers
        fields = {name: vectors(block.astype(np.float32), block.shape[1]) for name, block in values.items()}
    column = rr.ComponentColumn(component(VALUES, 0), struct_component(fields))
    recording.send_columns(entity, time_index(t_s), [column])


def _log_styles(recording: rr.RecordingStream, entity: str, styles: Mapping[str, rr.SeriesLines]) -> None:
    structs = struct_component({name: as_struct(style) for name, style in styles.items()})
    batch = rr.DescribedComponentBatch(structs, rr.ComponentDescriptor(component(STYLES, 0)))
    recording.log(entity, [batch], static=True)


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
