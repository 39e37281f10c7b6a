"""Outputs of a run: files and live view, opened before and closed after it, independent of each other."""

from __future__ import annotations

import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path
from threading import Semaphore
from typing import TYPE_CHECKING

from spheretwin.models.base.errors import InputError, SpheretwinError, without_breaks
from spheretwin.models.base.files import check_writable
from spheretwin.models.telemetry.parquet import TelemetryFile
from spheretwin.models.telemetry.run_record import RunRecord
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.provenance import facts_of, record_of
from spheretwin.session import Session
from spheretwin.simulation import Sink
from spheretwin.viz.layout.view import OVERVIEW

if TYPE_CHECKING:
    from spheretwin.viz.recording.live import LiveView
    from spheretwin.viz.recording.recorder import Recorder


def check(paths: list[Path]) -> None:
    """Check before a run that its files can be written.

    Raises
    ------
    InputError
        A file cannot be written, or two paths are equal.
    """
    for path in paths:
        check_writable(path)
    if len({path.resolve() for path in paths}) < len(paths):
        raise InputError(f"output: expected a separate path for each file, received {paths[0]} twice")


def check_rate(rate: float | None, record: Path | None, period_s: float) -> None:
    """Check the rate of a recording: there must be a recording, and the run must have enough rows.

    Raises
    ------
    InputError
        There is no recording, or the rate is above the control rate.
    """
    if rate is None:
        return
    if not record:
        raise InputError("command line: expected --record FILE.rrd with --record-rate, received none")
    if rate * period_s > 1 + 1e-9:  # both are rounded
        raise InputError(
            f"command line: expected --record-rate of at most {1 / period_s:g} Hz, the rate of the"
            f" controller, received {rate:g}"
        )


class Outputs:
    """Files and viewer that receive the telemetry of a session.

    Parameters
    ----------
    session : Session
        Before its first tick.
    record, telemetry : Path, optional
        Files to write.
    live : bool
        Serve a viewer at 127.0.0.1.
    view : str
        View of the recording that is open at first.
    record_rate_Hz : float, optional
        Rows per second of the recording, in addition to extremes and events; default: every row.
    first_tick : int
        Tick of the first row of the files.

    Attributes
    ----------
    record, telemetry : Path or None
        After `close`: files that were written completely.

    Raises
    ------
    InputError
        A file cannot be created, or the model cannot be drawn; no file remains.
    SpheretwinError
        No viewer can be served; no file remains.
    """

    def __init__(
        self,
        session: Session,
        record: Path | None,
        telemetry: Path | None,
        live: bool,
        view: str = OVERVIEW,
        record_rate_Hz: float | None = None,
        first_tick: int = 0,
    ) -> None:
        self._session, self._first_tick = session, first_tick
        self.record, self.telemetry = record, telemetry
        self._file: TelemetryFile | None = None
        if telemetry:
            self._begun = record_of(session, first_tick=first_tick)
            self._file = TelemetryFile(telemetry, session.signals, self._begun.metadata())
        self._live = _live_view(session, view) if live else None
        # The recorder last: it would leave a file if a later output were refused.
        try:
            self._recorder = _recorder_at_rate(session, record, view, record_rate_Hz) if record else None
        except SpheretwinError:
            if self._live:
                self._live.close()
            raise

    @property
    def sinks(self) -> list[Sink]:
        """Sinks of the telemetry."""
        sinks: list[Sink] = [sink for sink in (self._file, self._recorder, self._live) if sink]
        return [_FromTick(self._first_tick, sink) for sink in sinks] if self._first_tick else sinks

    def close(self) -> list[SpheretwinError]:
        """Complete every file; return the errors."""
        errors = []
        if self._live:
            try:
                self._live.close()
            except SpheretwinError as error:
                errors.append(error)
        if self._recorder:  # before the telemetry, as this frees memory
            try:
                self._recorder.close()
            except SpheretwinError as error:
                errors.append(error)
                self.record = None
        if self._file:
            try:
                record = record_of(self._session, self._begun, self._first_tick)
                self._file.close(record.metadata())
            except SpheretwinError as error:
                errors.append(error)
                self.telemetry = None
        return errors


class _FromTick:
    """Passes the rows from a tick on to a sink."""

    def __init__(self, first_tick: int, sink: Sink) -> None:
        self._remaining, self._sink = first_tick, sink

    def write(self, rows: Table) -> None:
        skipped = min(self._remaining, len(rows))
        self._remaining -= skipped
        if skipped < len(rows):
            self._sink.write(rows.rows(skipped, len(rows)))

    def note(self, t_s: float, text: str) -> None:
        if not self._remaining:
            self._sink.note(t_s, text)

    def finish(self, status: Status) -> None:
        self._sink.finish(status)


def _live_view(session: Session, view: str) -> LiveView:
    from spheretwin.viz.recording.live import LiveView  # Rerun is slow to import

    live = LiveView(session.actuator, session.signals, facts_of(session.begun_as), shown=view)
    print(f"watch: {live.address}", file=sys.stderr, flush=True)
    return live


def _recorder_at_rate(session: Session, path: Path, view: str, rate_Hz: float | None) -> Recorder:
    from spheretwin.viz.recording.recorder import Recorder  # Rerun is slow to import

    facts = facts_of(session.begun_as)
    return Recorder(session.actuator, session.signals, facts, path=path, shown=view, rate_Hz=rate_Hz)


if TYPE_CHECKING:
    from spheretwin.viz.recording.recorder import Recorder

# Chunks that may wait to be written; the loop waits for more, so that they do not accumulate in memory.
PENDING_CHUNKS = 64


class OpenedFiles:
    """Opened files of one recording.

    Parameters
    ----------
    session : Session
        Only read.
    recording, telemetry : Path, optional

    Raises
    ------
    InputError
        No path is given, a file cannot be created, or two paths are equal; no file remains.
    """

    def __init__(self, session: Session, recording: Path | None, telemetry: Path | None) -> None:
        self.paths = tuple(path for path in (recording, telemetry) if path)
        if not self.paths:
            raise InputError("bench: expected a file to record into, received none")
        import_writers()
        for path in self.paths:
            check_writable(path)
        if len({path.resolve() for path in self.paths}) < len(self.paths):
            raise InputError(f"output: expected a separate path for each file, received {recording} twice")
        self.telemetry = telemetry
        self.recorder = _recorder(session, recording) if recording else None

    def discard(self) -> None:
        """Close files that are not used."""
        if self.recorder:
            self.recorder.close()


class RecordingFiles:
    """Files of one recording, from the next tick on; a thread writes them.

    Parameters
    ----------
    files : OpenedFiles
    session : Session
        Session of the run.
    begun : RunRecord
        Record of the run at its start.
    """

    def __init__(self, files: OpenedFiles, session: Session, begun: RunRecord) -> None:
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
        """Errors, one line each."""

    def write(self, rows: Table) -> None:
        """Write the rows of one chunk, which must not change afterwards."""
        self._submit(lambda: [sink.write(rows) for sink in self._sinks])

    def note(self, t_s: float, text: str) -> None:
        """Note an event before the tick at `t_s`."""
        self._submit(lambda: [sink.note(t_s, text) for sink in self._sinks])

    def ending(self, session: Session) -> Callable[[Callable[[RecordingFiles], None]], None]:
        """Return a function that completes the files in the thread and then calls its argument."""
        status = Status.COMPLETED if session.status == Status.RUNNING else session.status
        record = record_of(session, self._begun, self._first_tick)

        def complete(done: Callable[[RecordingFiles], None]) -> None:
            for sink in self._sinks:
                sink.finish(status)
            if self._recorder:
                self._attempt(self._recorder.close)
            if self._file:
                file = self._file
                self._attempt(lambda: file.close(record.metadata()))
            done(self)

        def end(done: Callable[[RecordingFiles], None]) -> None:
            self._submit(lambda: complete(done))
            self._worker.shutdown(wait=False)

        return end

    def join(self) -> None:
        """Wait until the files are complete."""
        self._worker.shutdown()

    def _attempt(self, work: Callable[[], None]) -> None:
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
        except Exception as error:  # of the disk, Arrow or Rerun: the run continues and the error is reported
            self.faults.append(without_breaks(error) or type(error).__name__)
        finally:
            self._room.release()


def import_writers() -> None:
    """Import the modules of a recording in advance: the import is slow and blocks the interpreter."""
    for module in ("pyarrow.parquet", "spheretwin.viz.recording.recorder"):
        import_module(module)


def _recorder(session: Session, path: Path) -> Recorder:
    from spheretwin.viz.recording.recorder import Recorder  # Rerun is slow to import

    return Recorder(session.actuator, session.signals, facts_of(session.begun_as), path=path)
