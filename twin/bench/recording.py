"""Recordings of a bench: the files in progress, one recording at a time, and the completed ones."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib import import_module
from threading import Semaphore

from spheretwin.bench.driver import Driver
from spheretwin.bench.folder import release
from spheretwin.models.base.errors import without_breaks
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.records.outputs import Outputs
from spheretwin.records.provenance import change_text
from spheretwin.session import Session

# Writes that may wait; the loop waits for more, so that chunks do not accumulate in memory.
PENDING_WRITES = 128


def import_writers() -> None:
    """Import the modules of a recording in advance: the import is slow and blocks the interpreter."""
    for module in ("pyarrow.parquet", "spheretwin.viz.recording.recorder"):
        import_module(module)


class RecordingThread:
    """Thread that writes the files of one recording, from the next tick on.

    Parameters
    ----------
    files : Outputs
        Opened, but not begun.
    driver : Driver
        Runs the session.
    """

    def __init__(self, files: Outputs, driver: Driver) -> None:
        self._claimed = files.paths
        self.paths = tuple(map(str, self._claimed))
        files.begin(driver.session.tick, driver.start_record)
        self._files, self._sinks = files, files.sinks
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="recording")
        self._room = Semaphore(PENDING_WRITES)
        self.faults: list[str] = []
        """Errors, one line each."""

    def write(self, rows: Table) -> None:
        """Write the rows of one chunk, which must not change afterwards."""
        for sink in self._sinks:
            self._submit(partial(sink.write, rows))

    def note(self, t_s: float, text: str) -> None:
        """Note an event before the tick at `t_s`."""
        for sink in self._sinks:
            self._submit(partial(sink.note, t_s, text))

    def ending(self, session: Session) -> Callable[[Callable[[RecordingThread], None]], None]:
        """Return a function that completes the files in the thread and then calls its argument."""
        status = Status.COMPLETED if session.status == Status.RUNNING else session.status
        facts = self._files.facts()

        def complete(done: Callable[[RecordingThread], None]) -> None:
            for sink in self._sinks:
                sink.finish(status)
            self.faults.extend(map(str, self._files.close(facts)))
            release(self._claimed)  # of a file that could not be written, only its name is there
            done(self)

        def end(done: Callable[[RecordingThread], None]) -> None:
            self._submit(lambda: complete(done))
            self._worker.shutdown(wait=False)

        return end

    def join(self) -> None:
        """Wait until the files are complete."""
        self._worker.shutdown()

    def _submit(self, work: Callable[[], object]) -> None:
        self._room.acquire()
        self._worker.submit(self._perform, work)

    def _perform(self, work: Callable[[], object]) -> None:
        try:
            work()
        except Exception as error:  # of the disk, Arrow or Rerun: the run continues and the error is reported
            self.faults.append(without_breaks(error) or type(error).__name__)
        finally:
            self._room.release()


class Recording:
    """Recordings of one bench.

    Parameters
    ----------
    report : callable
        Takes the reason why a recording has ended, or its error.

    Attributes
    ----------
    completed_files : tuple of str
        Files that were written completely so far.
    """

    def __init__(self, report: Callable[[str | None], None]) -> None:
        self._report = report
        self.completed_files: tuple[str, ...] = ()
        self._active: RecordingThread | None = None
        self._completing: list[RecordingThread] = []
        self.reset()

    @property
    def on(self) -> bool:
        """True if a recording is being written."""
        return self._active is not None

    @property
    def paths(self) -> tuple[str, ...]:
        """Files that are being written."""
        return self._active.paths if self._active else ()

    def reset(self) -> None:
        """Reset at the beginning of a run."""
        self._noted = 0, 0

    def resume_from(self, session: Session) -> None:
        """Count the changes until now as written."""
        self._noted = len(session.journal), len(session.events)

    def begin(self, files: Outputs, driver: Driver) -> None:
        """Write opened files from the next tick on."""
        self.note_changes(driver.session)
        self._active = RecordingThread(files, driver)
        self._completing.append(self._active)

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, which must not change any more."""
        if active := self._active:  # the supervisor may end it meanwhile
            active.write(rows)

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

    def add_completed(self, *paths: str) -> None:
        """Add files that were written completely."""
        self.completed_files += paths

    def join(self) -> None:
        """Wait until all files are complete."""
        for files in list(self._completing):
            files.join()

    def _completed(self, files: RecordingThread) -> None:
        if files.faults:
            self._report(files.faults[0])
        else:
            self.add_completed(*files.paths)
        self._completing.remove(files)
