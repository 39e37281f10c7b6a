"""The run's log: what is worth a line, with its level."""

from __future__ import annotations

import numpy as np
import rerun as rr

from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.layout.paths import EVENTS
from spheretwin.viz.recording.columns import time_index
from spheretwin.viz.recording.parts.events import Event, Events
from spheretwin.viz.recording.parts.part import Part, Subject


class Log(Part):
    """Lines of what the telemetry shows, and how the run ended."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._events = Events()

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Log what is worth a line in a chunk."""
        log_lines(recording, self._events.of(rows))

    def finish(self, recording: rr.RecordingStream, status: Status) -> None:
        """Log how the run ended."""
        log_lines(recording, [self._events.end(status)])


def log_lines(recording: rr.RecordingStream, events: list[Event]) -> None:
    """Log some lines at their times."""
    if events:
        t_s, level, text = zip(*events, strict=True)
        lines = rr.TextLog.columns(text=list(text), level=list(level))
        recording.send_columns(EVENTS, time_index(np.array(t_s)), lines)
