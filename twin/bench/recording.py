"""What a bench records: the files that are being written, one recording at a time, and those that were."""

from __future__ import annotations

from collections.abc import Callable

from spheretwin.bench.driver import Desk
from spheretwin.faults.fault_injector import FaultMessages
from spheretwin.models.telemetry.table import Table
from spheretwin.outputs import OpenedFiles, RecordingFiles
from spheretwin.provenance import change_text
from spheretwin.session import Session


class Recording:
    """Recordings of one bench.

    Parameters
    ----------
    tell : callable
        Takes why a recording has ended, or what went wrong with it.

    Attributes
    ----------
    kept : tuple of str
        Files that were written last.
    """

    def __init__(self, tell: Callable[[str | None], None]) -> None:
        self._tell = tell
        self.kept: tuple[str, ...] = ()
        self._present: RecordingFiles | None = None
        self._completing: list[RecordingFiles] = []
        self.begin_anew()

    @property
    def on(self) -> bool:
        """Whether something is being recorded."""
        return self._present is not None

    @property
    def paths(self) -> tuple[str, ...]:
        """Files that are being written."""
        return tuple(str(path) for path in self._present.paths) if self._present else ()

    def begin_anew(self) -> None:
        """A run begins: nothing has happened in it."""
        self._faults, self._noted = FaultMessages(), (0, 0)

    def go_on_from(self, session: Session) -> None:
        """What was changed until now has been told."""
        self._noted = len(session.journal), len(session.events)

    def begin(self, files: OpenedFiles, desk: Desk) -> None:
        """Write opened files from the next tick on."""
        self.note_changes(desk.session)
        self._present = RecordingFiles(files, desk.session, desk.begun)
        self._completing.append(self._present)

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, which must not change any more."""
        if self._present is None:
            return
        self._present.write(rows)
        for t_s, text in self._faults.of(rows):
            self._present.note(t_s, text)

    def note_changes(self, session: Session) -> None:
        """Tell what was changed since it was last told."""
        made, planned = self._noted
        if self._present:
            period_s = session.scenario.controller.period_s
            for change in (*session.journal[made:], *session.events[planned:]):
                self._present.note(change.tick * period_s, change_text(change))
        self.go_on_from(session)

    def ending(self, session: Session) -> Callable[..., None] | None:
        """What completes the files as the session is now, if there are any."""
        return self._present.ending(session) if self._present else None

    def end(self, session: Session, why: str | None, end: Callable[..., None] | None = None) -> None:
        """Complete what is being recorded, if anything is, beside the loop.

        Parameters
        ----------
        session : Session
        why : str or None
            To be told.
        end : callable, optional
            From `ending`, where the session is no longer what it was.
        """
        if self._present is None:
            return
        keeping, self._present = self._present, None
        self._tell(why)
        (end or keeping.ending(session))(self._completed)

    def join(self) -> None:
        """Wait until all files are complete."""
        for keeping in list(self._completing):
            keeping.join()

    def _completed(self, keeping: RecordingFiles) -> None:
        self.kept = tuple(str(path) for path in keeping.paths)
        if keeping.faults:
            self.kept = ()
            self._tell(keeping.faults[0])
        self._completing.remove(keeping)
