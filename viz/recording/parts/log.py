"""The run's log: what is worth a line, with its level."""

from __future__ import annotations

import numpy as np
import rerun as rr

from spheretwin.models.telemetry.checksums import line_checksums
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.layout.paths import EVENTS
from spheretwin.viz.recording.columns import checksums, nanoseconds, time_index, total
from spheretwin.viz.recording.parts.events import Event, Events
from spheretwin.viz.recording.parts.part import Part, Subject


class Log(Part):
    """Lines of what the telemetry shows, and how the run ended."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._events = Events()
        self._lines = 0

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Log what is worth a line in a chunk."""
        self._log(recording, self._events.of(rows))

    def note(self, recording: rr.RecordingStream, event: Event) -> None:
        """Log an event that the rows do not show."""
        self._log(recording, [event])

    def finish(self, recording: rr.RecordingStream, status: Status) -> None:
        """Log how the run ended."""
        self._log(recording, [self._events.end(status)])

    def close(self, recording: rr.RecordingStream) -> None:
        """Log the number of lines."""
        recording.log(EVENTS, [total(self._lines)], static=True)

    def _log(self, recording: rr.RecordingStream, events: list[Event]) -> None:
        log_lines(recording, events, self._lines)
        self._lines += len(events)


def log_lines(recording: rr.RecordingStream, events: list[Event], first: int = 0) -> None:
    """Log some lines at their times.

    Parameters
    ----------
    recording : rr.RecordingStream
    events : list of Event
    first : int
        Number of the first of them.
    """
    if events:
        t_s, level, text = zip(*events, strict=True)
        lines = rr.TextLog.columns(text=list(text), level=list(level))
        t_ns = nanoseconds(np.array(t_s)).tolist()
        sums = line_checksums(list(zip(t_ns, level, text, strict=True)), first)
        recording.send_columns(EVENTS, time_index(np.array(t_s)), [*lines, checksums(sums)])
