"""Recordings of a bench: the files in progress, one recording at a time, and the completed ones."""

from __future__ import annotations

from collections.abc import Callable

from spheretwin.bench.driver import Driver
from spheretwin.faults.fault_injector import FaultMessages
from spheretwin.models.telemetry.table import Table
from spheretwin.outputs import OpenedFiles, RecordingFiles
from spheretwin.provenance import change_text
from spheretwin.session import Session


class Recording:
    """Recordings of one bench.

    Parameters
    ----------
    report : callable
        Takes the reason why a recording has ended, or its error.

    Attributes
    ----------
    completed_files : tuple of str
        Files that were completed last.
    """

    def __init__(self, report: Callable[[str | None], None]) -> None:
        self._report = report
        self.completed_files: tuple[str, ...] = ()
        self._active: RecordingFiles | None = None
        self._completing: list[RecordingFiles] = []
        self.reset()

    @property
    def on(self) -> bool:
        """True if a recording is being written."""
        return self._active is not None

    @property
    def paths(self) -> tuple[str, ...]:
        """Files that are being written."""
        return tuple(str(path) for path in self._active.paths) if self._active else ()

    def reset(self) -> None:
        """Reset at the beginning of a run."""
        self._faults, self._noted = FaultMessages(), (0, 0)

    def resume_from(self, session: Session) -> None:
        """Count the changes until now as written."""
        self._noted = len(session.journal), len(session.events)

    def begin(self, files: OpenedFiles, driver: Driver) -> None:
        """Write opened files from the next tick on."""
        self.note_changes(driver.session)
        self._active = RecordingFiles(files, driver.session, driver.start_record)
        self._completing.append(self._active)

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, which must not change any more."""
        if self._active is None:
            return
        self._active.write(rows)
        for t_s, text in self._faults.of(rows):
            self._active.note(t_s, text)

    def note_changes(self, session: Session) -> None:
        """Write the changes since the last call."""
        changes_done, events_done = self._noted
        if self._active:
            period_s = session.scenario.controller.period_s
            for change in (*session.journal[changes_done:], *session.events[events_done:]):
                self._active.note(change.tick * period_s, change_text(change))
        self.resume_from(session)

    def ending(self, session: Session) -> Callable[..., None] | None:
        """Return the function that completes the files with the session as it is now, if there are any."""
        return self._active.ending(session) if self._active else None

    def end(self, session: Session, why: str | None, end: Callable[..., None] | None = None) -> None:
        """Complete the recording in progress, if any, outside the loop.

        Parameters
        ----------
        session : Session
        why : str or None
            Reason, which is reported.
        end : callable, optional
            From `ending`, where the session is no longer what it was.
        """
        if self._active is None:
            return
        files, self._active = self._active, None
        self._report(why)
        (end or files.ending(session))(self._completed)

    def join(self) -> None:
        """Wait until all files are complete."""
        for files in list(self._completing):
            files.join()

    def _completed(self, files: RecordingFiles) -> None:
        self.completed_files = tuple(str(path) for path in files.paths)
        if files.faults:
            self.completed_files = ()
            self._report(files.faults[0])
        self._completing.remove(files)
