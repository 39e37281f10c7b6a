"""The telemetry itself: every signal in each row that is kept, bit for bit, and what it is."""

from __future__ import annotations

import rerun as rr

from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.layout.paths import entity
from spheretwin.viz.layout.styles import signal_style
from spheretwin.viz.recording.columns import scalars, time_index
from spheretwin.viz.recording.parts.described import COMPLETE, signal_as_json
from spheretwin.viz.recording.parts.part import Part, Rows, Subject


class Signals(Part):
    """Every column of the telemetry."""

    rows = Rows.KEPT

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._described: set[str] = set()

    def begin(self, recording: rr.RecordingStream) -> None:
        """Say what the signals are."""
        self._describe(recording, self.subject.signals)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the values of a chunk."""
        index = time_index(rows["t_s"])
        self._describe(recording, rows.signals)
        # The times last: rows that have them are whole, wherever a killed process left off.
        for signal in sorted(rows.signals, key=lambda signal: signal.name == COMPLETE):
            recording.send_columns(entity(signal.name), index, [scalars(rows[signal.name], signal.size)])

    def _describe(self, recording: rr.RecordingStream, signals: tuple[Signal, ...]) -> None:
        """Say of signals that come for the first time what they are; a change of law may bring some."""
        new = [signal for signal in signals if signal.name not in self._described]
        for signal in new:
            described = signal_as_json(len(self._described), signal)
            # Time is an axis, and no line over itself.
            drawn = [] if signal.name == COMPLETE else [signal_style(signal)]
            recording.log(entity(signal.name), described, *drawn, static=True)
            self._described.add(signal.name)
        if new:
            recording.flush()  # before their rows: what a killed process leaves says what they are
