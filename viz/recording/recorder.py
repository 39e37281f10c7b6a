"""A run as a Rerun recording in a file."""

from __future__ import annotations

from pathlib import Path

import rerun as rr

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError, SpheretwinError, without_breaks
from spheretwin.models.base.files import OPEN_FILES, OutputFile, PartialFile
from spheretwin.models.telemetry.run_record import RunFacts
from spheretwin.models.telemetry.signals import Signal
from spheretwin.viz.decimation import FirstAndExtremeRows, RowSelection
from spheretwin.viz.layout.view import OVERVIEW
from spheretwin.viz.recording.file_pipe import PIPE_PATHS, FilePipe
from spheretwin.viz.recording.stream import Stream

# Each chunk of each entity costs some time and bytes, whatever its length. Chunks therefore grow.
FEWEST_ROWS, MOST_ROWS = 1_500, 12_288

# Time that an ending process waits for each step of the recording.
PATIENCE_s = 2.0


class Recorder(Stream):
    """Takes a run's telemetry chunk by chunk and writes it to a recording.

    Every signal is recorded at the rate of the control ticks, or at a lower one with all extremes
    (`decimation.FirstAndExtremeRows`), bit for bit; currents of the coils as the signals, or at 60 Hz if
    these have a lower rate; poses and traces at 60 Hz; events and states from all rows. The file gets its
    name when the recording closes; until then it is hidden, under a temporary name that ends in ``.part``.

    Parameters
    ----------
    actuator, signals, facts, shown, rate_Hz
        As for `Stream`.
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
        selection = FirstAndExtremeRows(rate_Hz) if rate_Hz else RowSelection()
        super().__init__(actuator, signals, facts, selection, live=False, shown=shown, rate_Hz=rate_Hz)
        self._path = path
        self._output = OutputFile(path)
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

    def due(self) -> int:
        """Rows that are recorded together: more as the recording grows."""
        return min(max(FEWEST_ROWS, self.rows_handed_over // 4), MOST_ROWS)

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
