"""The telemetry itself: every signal in each row that is kept, bit for bit, and what it is."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.telemetry.checksums import values_checksum
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.layout.paths import STYLES, TELEMETRY, VALUES, component
from spheretwin.viz.layout.styles import LOOKS, signal_style
from spheretwin.viz.recording.columns import Struct, no_vectors, range_checksum, time_index, total, vectors
from spheretwin.viz.recording.parts.described import signals_as_json
from spheretwin.viz.recording.parts.part import Part, Rows, Subject

# An axis, and no line over itself.
TIME = "t_s"


class Signals(Part):
    """Every column of the telemetry, all of a row together: a killed process leaves whole rows."""

    rows = Rows.KEPT

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._arrived: list[list[Signal]] = []
        self._rows = 0

    def begin(self, recording: rr.RecordingStream) -> None:
        """Say what the signals are."""
        self._describe(recording, self.subject.signals)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the values of a chunk."""
        self._describe(recording, rows.signals)
        names = {signal.name for signal in rows.signals}
        columns = [
            rr.ComponentColumn(component(VALUES, arrival), _values(rows, signals, names))
            for arrival, signals in enumerate(self._arrived)
            if any(signal.name in names for signal in signals)
        ]
        self._check(recording, rows)
        recording.send_columns(TELEMETRY, time_index(rows["t_s"]), columns)

    def close(self, recording: rr.RecordingStream) -> None:
        """Log the number of rows."""
        recording.log(TELEMETRY, [total(self._rows)], static=True)

    def _check(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the checksum of the rows of a chunk, before them: none is ever without one."""
        sums = range_checksum(self._rows, len(rows), values_checksum(self._in_order(rows)))
        recording.send_columns(TELEMETRY, time_index(rows["t_s"][:1]), [sums])
        self._rows += len(rows)

    def _in_order(self, rows: Table) -> NDArray[np.float64]:
        """Values of a chunk, signals in the order in which they came: a law may bring back earlier ones."""
        names = {signal.name for signal in rows.signals}
        order = [signal for arrived in self._arrived for signal in arrived if signal.name in names]
        if list(rows.signals) == order:
            return rows.values
        return np.concatenate([rows[each.name].reshape(len(rows), -1) for each in order], axis=1)

    def _describe(self, recording: rr.RecordingStream, signals: tuple[Signal, ...]) -> None:
        """Say of signals that come for the first time what they are; a change of law may bring some."""
        known = {signal.name for arrived in self._arrived for signal in arrived}
        new = [signal for signal in signals if signal.name not in known]
        if not new:
            return
        arrival = len(self._arrived)
        self._arrived.append(new)
        styles = Struct({signal.name: _style(signal) for signal in new if signal.name != TIME})
        drawn = rr.DescribedComponentBatch(styles, rr.ComponentDescriptor(component(STYLES, arrival)))
        recording.log(TELEMETRY, [*signals_as_json(arrival, new), drawn], static=True)
        recording.flush()  # before their rows: what a killed process leaves says what they are


def _values(rows: Table, signals: list[Signal], names: set[str]) -> Struct:
    """Values of signals that came together; none of those that the rows do not have any more."""
    return Struct(
        {
            signal.name: vectors(rows[signal.name], signal.size)
            if signal.name in names
            else no_vectors(len(rows), signal.size)
            for signal in signals
        }
    )


def _style(signal: Signal) -> pa.Array:
    """How a signal's lines look: what `rr.SeriesLines` has of it, as lists in a struct."""
    style = signal_style(signal)
    return pa.StructArray.from_arrays([_look(getattr(style, look)) for look in LOOKS], list(LOOKS))


def _look(batch: rr.ComponentBatchLike | None) -> pa.Array:
    """One list; none where the viewer may choose."""
    if batch is None:
        return pa.nulls(1, pa.list_(pa.uint8(), 1))
    values = batch.as_arrow_array()
    return pa.FixedSizeListArray.from_arrays(values, len(values))
