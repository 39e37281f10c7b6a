"""Files and live view of a run: opened before it, closed after it, each whatever becomes of the other."""

from __future__ import annotations

import argparse
import math
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
    """Find out before a run whether its files can be written.

    Raises
    ------
    InputError
        One cannot, or two are one.
    """
    for path in paths:
        check_writable(path)
    if len({path.resolve() for path in paths}) < len(paths):
        raise InputError(f"output: expected a path of its own for each file, received {paths[0]} twice")


def rate_Hz(text: str) -> float:
    """A rate from the command line, Hz."""
    try:
        rate = float(text)
    except ValueError:
        rate = math.nan
    if not 0 < rate < math.inf:
        raise argparse.ArgumentTypeError(f"expected a number of Hz above 0, received {text}")
    return rate


def check_rate(rate: float | None, record: Path | None, period_s: float) -> None:
    """Refuse a rate of a recording that is not asked for, or one that no run has the rows for.

    Raises
    ------
    InputError
        It is one of these.
    """
    if rate is None:
        return
    if not record:
        raise InputError("command line: expected --record FILE.rrd with --record-rate, received none")
    if rate * period_s > 1 + 1e-9:  # both are rounded
        raise InputError(
            f"command line: expected --record-rate of at most {1 / period_s:g} Hz, at which the controller"
            f" works, received {rate:g}"
        )


class Outputs:
    """What follows a session into files and into a viewer.

    Parameters
    ----------
    session : Session
        Before its first tick.
    record, telemetry : Path, optional
        Files to write.
    live : bool
        Serve a viewer on 127.0.0.1.
    view : str
        What of the recording is open at first.
    record_rate_Hz : float, optional
        Rows a second that the recording keeps beside those that stand out; every row unless given.
    first_tick : int
        Tick of the first row that the files keep.

    Attributes
    ----------
    record, telemetry : Path or None
        Files that were written whole, once they are closed.

    Raises
    ------
    InputError
        A file cannot be made, or the model cannot be drawn; nothing is left behind.
    SpheretwinError
        There is no viewer to serve; nothing is left behind.
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
        # The recorder last: it alone leaves something where it is made and another is refused.
        try:
            self._recorder = _recorder_at_rate(session, record, view, record_rate_Hz) if record else None
        except SpheretwinError:
            if self._live:
                self._live.close()
            raise

    @property
    def sinks(self) -> list[Sink]:
        """To be handed the telemetry."""
        sinks: list[Sink] = [sink for sink in (self._file, self._recorder, self._live) if sink]
        return [_From(self._first_tick, sink) for sink in sinks] if self._first_tick else sinks

    def close(self) -> list[SpheretwinError]:
        """Complete every file; returns what went wrong."""
        faults = []
        if self._live:
            try:
                self._live.close()
            except SpheretwinError as error:
                faults.append(error)
        if self._recorder:  # before the telemetry: its memory is free then
            try:
                self._recorder.close()
            except SpheretwinError as error:
                faults.append(error)
                self.record = None
        if self._file:
            try:
                record = record_of(self._session, self._begun, self._first_tick)
                self._file.close(record.metadata())
            except SpheretwinError as error:
                faults.append(error)
                self.telemetry = None
        return faults


class _From:
    """Hands a sink the rows from a tick on."""

    def __init__(self, first_tick: int, sink: Sink) -> None:
        self._left, self._sink = first_tick, sink

    def write(self, rows: Table) -> None:
        passed = min(self._left, len(rows))
        self._left -= passed
        if passed < len(rows):
            self._sink.write(rows.rows(passed, len(rows)))

    def note(self, t_s: float, text: str) -> None:
        if not self._left:
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
