"""Files that are written from some tick on, beside the loop: it waits for none of them."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path
from threading import Semaphore
from typing import TYPE_CHECKING

from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.base.files import check_writable
from spheretwin.models.base.wording import without_breaks
from spheretwin.models.telemetry.file import TelemetryFile
from spheretwin.models.telemetry.record import RunRecord
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.twin.records.facts import facts_of, record_of
from spheretwin.twin.session import Session

if TYPE_CHECKING:
    from spheretwin.viz.recording.recorder import Recorder

# Chunks handed over and not yet written; beyond these the loop waits, so that they do not gather in memory.
PENDING_CHUNKS = 64


class Files:
    """The files of one recording, opened.

    Parameters
    ----------
    session : Session
        Read alone.
    recording, telemetry : Path, optional

    Raises
    ------
    InputError
        None is given, one cannot be made, or two are one; nothing is left behind.
    """

    def __init__(self, session: Session, recording: Path | None, telemetry: Path | None) -> None:
        self.paths = tuple(path for path in (recording, telemetry) if path)
        if not self.paths:
            raise InputError("bench: expected a file to record into, received none")
        warm()
        for path in self.paths:
            check_writable(path)
        if len({path.resolve() for path in self.paths}) < len(self.paths):
            raise InputError(f"output: expected a path of its own for each file, received {recording} twice")
        self.telemetry = telemetry
        self.recorder = _recorder(session, recording) if recording else None

    def discard(self) -> None:
        """Close what was opened for nothing."""
        if self.recorder:
            self.recorder.close()


class Keeping:
    """One recording, from the next tick on.

    Parameters
    ----------
    files : Files
    session : Session
        The files are of its run.
    begun : RunRecord
        Record of the run when it began.
    """

    def __init__(self, files: Files, session: Session, begun: RunRecord) -> None:
        self.paths, self._recorder = files.paths, files.recorder
        self._begun, self._first_tick = begun, session.tick
        self._file = None
        if files.telemetry:
            record = record_of(session, begun, session.tick)
            self._file = TelemetryFile(files.telemetry, session.signals, record.metadata())
        self._sinks = [sink for sink in (self._file, self._recorder) if sink]
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="keeping")
        self._room = Semaphore(PENDING_CHUNKS)
        self.faults: list[str] = []
        """What went wrong, one line each."""

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, which must not change any more."""
        self._submit(lambda: [sink.write(rows) for sink in self._sinks])

    def note(self, t_s: float, text: str) -> None:
        """Take note of what happened before the tick at `t_s`."""
        self._submit(lambda: [sink.note(t_s, text) for sink in self._sinks])

    def ending(self, session: Session) -> Callable[[Callable[[Keeping], None]], None]:
        """What completes the files as the session is now, beside the loop, and tells its argument then."""
        status = Status.COMPLETED if session.status == Status.RUNNING else session.status
        record = record_of(session, self._begun, self._first_tick)

        def complete(done: Callable[[Keeping], None]) -> None:
            for sink in self._sinks:
                sink.finish(status)
            if self._recorder:
                self._tried(self._recorder.close)
            if self._file:
                file = self._file
                self._tried(lambda: file.close(record.metadata()))
            done(self)

        def end(done: Callable[[Keeping], None]) -> None:
            self._submit(lambda: complete(done))
            self._worker.shutdown(wait=False)

        return end

    def join(self) -> None:
        """Wait until the files are complete."""
        self._worker.shutdown()

    def _tried(self, work: Callable[[], None]) -> None:
        try:
            work()
        except SpheretwinError as error:
            self.faults.append(str(error))

    def _submit(self, work: Callable[[], object]) -> None:
        self._room.acquire()
        self._worker.submit(self._perform, work)

    def _perform(self, work: Callable[[], object]) -> None:
        try:
            work()
        except Exception as error:  # of the disk, Arrow or Rerun: the run goes on, and its faults are told
            self.faults.append(without_breaks(error) or type(error).__name__)
        finally:
            self._room.release()


def warm() -> None:
    """Import what a recording needs: slow, and it holds the interpreter."""
    for module in ("pyarrow.parquet", "spheretwin.viz.recording.recorder"):
        import_module(module)


def _recorder(session: Session, path: Path) -> Recorder:
    from spheretwin.viz.recording.recorder import Recorder  # Rerun is slow to import

    return Recorder(session.actuator, session.signals, facts_of(session.begun_as), path=path)
