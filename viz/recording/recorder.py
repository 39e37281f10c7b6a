"""A run as a Rerun recording in a file."""

from __future__ import annotations

import os
import select
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from io import FileIO
from pathlib import Path
from threading import Lock, Thread
from uuid import uuid4

import rerun as rr
import rerun.blueprint as rrb

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError, SpheretwinError, without_breaks
from spheretwin.models.base.files import OPEN_FILES, OutputFile, PartialFile, whole_file
from spheretwin.models.telemetry.run_record import RunFacts
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.decimation import FirstAndExtremeRows
from spheretwin.viz.layout.view import OVERVIEW, application
from spheretwin.viz.recording.part import RecordingSubject
from spheretwin.viz.recording.stream import PATIENCE_s, Stream, parts_of_run

PIPE_PATHS = Path("/dev/fd")
"""Folder in which a pipe has a path, by its number; Windows has none, and Rerun writes files itself."""

_BLOCK_BYTES = 1 << 20


class FilePipe:
    """Pipe whose content a thread writes to a file.

    Rerun can write files itself, but after a full disk has ended its writer, it waits forever at the
    next flush, and reports the cause to its own log only. With a pipe it is independent of the disk.

    Parameters
    ----------
    path : Path
        File to write.

    Attributes
    ----------
    path : Path
        Path at which Rerun writes to the pipe.
    error : OSError or None
        Error of writing or closing the file; later content is dropped.

    Raises
    ------
    OSError
        The file or the pipe cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        file = path.open("wb", buffering=0)
        try:
            reading, self._writing = os.pipe()
            _enlarge(self._writing)
        except OSError:
            file.close()
            raise
        self.path = PIPE_PATHS / str(self._writing)
        self.error: OSError | None = None
        self._block = Lock()
        self._thread = Thread(target=self._copy, args=(reading, file), name="recording file", daemon=True)
        self._thread.start()

    def drain(self, timeout_s: float) -> None:
        """Wait until the present content of the pipe is in the file, or the time is over."""
        import fcntl  # not on Windows, which has no such pipe
        import termios

        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            with self._block:
                count = fcntl.ioctl(self._writing, termios.FIONREAD, b"\0" * 4)
            if not any(count):
                return
            time.sleep(0.01)

    def close(self) -> None:
        """Wait until all that was written to the pipe is in the file."""
        os.close(self._writing)
        self._thread.join()

    def _copy(self, reading: int, file: FileIO) -> None:
        with open(reading, "rb", buffering=0) as pipe:
            try:
                with file:
                    while self._copy_block(pipe, file):
                        pass
            except OSError as error:
                self.error = error
                while pipe.read(_BLOCK_BYTES):  # else Rerun would wait for room in the pipe
                    pass

    def _copy_block(self, pipe: FileIO, file: FileIO) -> bool:
        """Copy a block; False at the end of the pipe."""
        select.select([pipe], [], [])
        with self._block:  # content that is no longer in the pipe is in the file when this lock is released
            block = pipe.read(_BLOCK_BYTES)
            _write_all(file, block)
        return bool(block)


def _enlarge(pipe: int) -> None:
    """Let a pipe hold a block, if the system can: its thread has to wait for the interpreter less often."""
    import fcntl  # not on Windows, which has no such pipe

    if command := getattr(fcntl, "F_SETPIPE_SZ", None):
        with suppress(OSError):  # the pipes of a user have a total size
            fcntl.fcntl(pipe, command, _BLOCK_BYTES)


def _write_all(file: FileIO, block: bytes) -> None:
    rest = memoryview(block)
    while rest:
        rest = rest[file.write(rest) :]


@contextmanager
def recorded(
    path: Path, application: str, layout: rrb.Blueprint | None = None
) -> Iterator[rr.RecordingStream]:
    """Give a stream whose recording takes the name `path` when the block ends well.

    Parameters
    ----------
    path : Path
    application : str
        Application id: a viewer keeps one layout for each.
    layout : Blueprint, optional
        The block sends one unless given.

    Raises
    ------
    InputError
        No file can be made there.
    SpheretwinError
        Writing failed; the previous file is unchanged.
    """
    rr.set_strict_mode(True)  # otherwise a mistake is a warning, and its data are dropped
    with whole_file(path, ".rrd") as temporary:
        pipe = FilePipe(temporary) if PIPE_PATHS.is_dir() else None
        stream = rr.RecordingStream(application)
        try:
            stream.set_log_time_enabled(False)  # simulated time is the only one that means anything
            stream.set_sinks(rr.FileSink(pipe.path if pipe else temporary), default_blueprint=layout)
            yield stream
            stream.flush()
        finally:
            stream.disconnect()
            if pipe:
                pipe.close()
        if pipe and pipe.error:
            raise pipe.error


# Each chunk of each entity costs some time and bytes, whatever its length. Chunks therefore grow.
FEWEST_ROWS, MOST_ROWS = 1_500, 12_288


class Recorder(Stream):
    """Takes a run's telemetry chunk by chunk and writes it to a recording.

    Every signal is recorded at the rate of the control ticks, or at a lower one with all extremes
    (`decimation.FirstAndExtremeRows`), bit for bit; currents of the coils as the signals, or at 60 Hz if
    these have a lower rate; poses and traces at 60 Hz; events and states from all rows. The file gets its
    name when the recording closes; until then it is hidden, under a temporary name that ends in ``.part``.

    Parameters
    ----------
    actuator, signals, facts, shown, rate_Hz
        As for `RecordingSubject`.
    path : Path
        Recording to write.

    Raises
    ------
    InputError
        A mesh of the model cannot be read, or no file can be written at `path`; no file remains there.
    """

    def __init__(
        self,
        actuator: Actuator,
        signals: tuple[Signal, ...],
        facts: RunFacts,
        *,
        path: Path,
        shown: str = OVERVIEW,
        rate_Hz: float | None = None,
    ) -> None:
        run = uuid4().hex
        subject = RecordingSubject(actuator, signals, facts, shown=shown, run=run, rate_Hz=rate_Hz)
        selection = FirstAndExtremeRows(rate_Hz) if rate_Hz else None
        super().__init__(subject, parts_of_run(subject), application(subject.view), selection)
        self._path = path
        self._output = OutputFile(path, ".rrd")
        self._pipe = _pipe_to(self._output) if PIPE_PATHS.is_dir() else None
        self.begin()
        OPEN_FILES.add(self)

    def partial(self) -> PartialFile | None:
        """Record the rows that wait; return the partial file, if there are rows."""
        self.flush(PATIENCE_s)
        if self._pipe:
            self._pipe.drain(PATIENCE_s)
        if not (self.rows_handed_over and self._output.path.exists()):
            return None
        return PartialFile(self._output.path, self._path, self.rows_handed_over)

    def connect(self) -> None:
        """Open the file."""
        sink = rr.FileSink((self._pipe or self._output).path)
        self.recording.set_sinks(sink)

    def is_due(self, waiting: Sequence[Table]) -> bool:
        """Return True if the waiting rows are recorded now: more together as the recording grows."""
        return sum(map(len, waiting)) >= min(max(FEWEST_ROWS, self.rows_handed_over // 4), MOST_ROWS)

    def send(self) -> None:
        """Leave the recorded data to Rerun's threads, which encode them meanwhile."""

    def complete(self) -> None:
        """Complete the file and give it its name.

        Raises
        ------
        SpheretwinError
            Some of the recording could not be made or written; the incomplete file keeps ``.part``.
        """
        try:
            self._complete()
        finally:
            OPEN_FILES.remove(self)

    def _complete(self) -> None:
        self.recording.disconnect()
        if self._pipe:
            self._pipe.close()
        if self._pipe and self._pipe.error:
            self.fault = self._pipe.error.strerror or f"{self._pipe.error!r}"
        if self.fault:
            raise SpheretwinError(
                f"recording: {self._path} could not be completed, {self.fault};"
                f" the incomplete recording is in {self._output.path}"
            )
        try:
            self._output.keep()
        except SpheretwinError as error:
            raise SpheretwinError(f"{error}; the recording is in {self._output.path}") from None


def _pipe_to(output: OutputFile) -> FilePipe:
    try:
        return FilePipe(output.path)
    except OSError as error:
        output.discard()
        raise InputError(f"output: expected a writable path, {without_breaks(error)}") from None
