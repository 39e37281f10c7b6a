"""A part of a recording: what it logs at the start, of every chunk, and at the end."""

from __future__ import annotations

from typing import NamedTuple

import rerun as rr

from spheretwin.models.actuator import Actuator
from spheretwin.models.telemetry.facts import RunFacts
from spheretwin.models.telemetry.signals import COMMON_NAMES, Signal
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.layout.view import OVERVIEW, View


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
            self.run,
        )


class Part:
    """Logs nothing; a subclass says what it logs, and when.

    Parameters
    ----------
    subject : Subject
        What is recorded.
    """

    def __init__(self, subject: Subject) -> None:
        self.subject = subject

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log what stays the same."""

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Log the rows of one chunk, of which there is at least one."""

    def finish(self, recording: rr.RecordingStream, status: Status) -> None:
        """Log how the run ended."""
