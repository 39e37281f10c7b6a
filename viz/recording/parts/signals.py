"""The telemetry itself: every signal in each row that is kept, bit for bit, and what it is."""

from __future__ import annotations

import rerun as rr

from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.layout.layout import plotted
from spheretwin.viz.layout.paths import TELEMETRY, entity
from spheretwin.viz.layout.styles import log_styles
from spheretwin.viz.recording.columns import scalars, time_index
from spheretwin.viz.recording.parts.described import COMPLETE, signals_as_json
from spheretwin.viz.recording.parts.part import Part, Rows, Subject


class Signals(Part):
    """Every column of the telemetry."""

    rows = Rows.KEPT

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._described: dict[str, Signal] = {}

    def begin(self, recording: rr.RecordingStream) -> None:
        """Say what the signals are."""
        log_styles(recording, self.subject.signals, plotted(self.subject.view))
        self._describe(recording, self.subject.signals)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the values of a chunk."""
        index = time_index(rows["t_s"])
        self._describe(recording, rows.signals)
        # The times last: rows that have them are whole, wherever a killed process left off.
        for signal in sorted(rows.signals, key=lambda signal: signal.name == COMPLETE):
            recording.send_columns(entity(signal.name), index, [scalars(rows[signal.name], signal.size)])

    def _describe(self, recording: rr.RecordingStream, signals: tuple[Signal, ...]) -> None:
        """Say what all signals are once some come for the first time; a change of law may bring some."""
        if all(signal.name in self._described for signal in signals):
            return
        self._described |= {signal.name: signal for signal in signals}
        recording.log(TELEMETRY, signals_as_json(tuple(self._described.values())), static=True)
        recording.flush()  # before their rows: what a killed process leaves says what they are
