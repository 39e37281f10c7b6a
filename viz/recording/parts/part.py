"""A part of a recording: what it logs at the start, of every chunk, and at the end."""

from __future__ import annotations

from enum import Enum
from typing import ClassVar, NamedTuple

import rerun as rr

from spheretwin.models.actuator import Actuator
from spheretwin.models.telemetry.facts import RunFacts
from spheretwin.models.telemetry.signals import COMMON_NAMES, Signal
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.layout.view import OVERVIEW, View
from spheretwin.viz.recording.parts.events import Event
from spheretwin.viz.scene.marks import size_of


class Rows(Enum):
    """Which rows of a run a part is given."""

    ALL = "all"
    """Every row, at once: for what thins them itself, or must not miss any."""
    KEPT = "kept"
    """Those that the recording keeps, whole; known some seconds later where it is thinned."""


class Subject(NamedTuple):
    """What is recorded."""

    actuator: Actuator
    """Has as many groups as the telemetry has currents."""
    signals: tuple[Signal, ...]
    """Columns of the telemetry at the start; a change of law may bring others."""
    facts: RunFacts
    live: bool = False
    """Whether it is watched while it runs."""
    shown: str = OVERVIEW
    """The view of it that is open at first."""
    run: str = ""
    """What tells this recording from all others."""
    rate_Hz: float | None = None
    """Rows a second that are kept beside those that stand out; None for every row."""

    @property
    def view(self) -> View:
        """What its layout is made for."""
        return View(
            self.facts.duration_s,
            self.facts.current_limit_A,
            len(self.actuator.groups),
            tuple(signal for signal in self.signals if signal.name not in COMMON_NAMES),
            self.live,
            self.shown,
            size_of(self.actuator),
            self.run,
        )


class Part:
    """Logs nothing; a subclass says what it logs, and when.

    Parameters
    ----------
    subject : Subject
        What is recorded.

    Attributes
    ----------
    rows : Rows
        Which rows `write` is given.
    """

    rows: ClassVar[Rows] = Rows.ALL

    def __init__(self, subject: Subject) -> None:
        self.subject = subject

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log what stays the same."""

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Log the rows of one chunk, of which there is at least one."""

    def note(self, recording: rr.RecordingStream, event: Event) -> None:
        """Log an event that the rows do not show."""

    def finish(self, recording: rr.RecordingStream, status: Status) -> None:
        """Log how the run ended."""

    def close(self, recording: rr.RecordingStream) -> None:
        """Log what is known when nothing else will be logged."""
