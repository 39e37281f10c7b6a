"""A run as a Rerun recording: written to a file, watched live, or both."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Semaphore
from types import TracebackType
from typing import Any
from uuid import uuid4

import numpy as np
import rerun as rr

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.base.files import OutputFile
from spheretwin.models.base.wording import without_breaks
from spheretwin.models.telemetry.facts import RunFacts
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.status import Level, Status, named
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.layout.layout import opening_layout
from spheretwin.viz.layout.view import OVERVIEW, View, application
from spheretwin.viz.recording.file_pipe import PIPE_PATHS, FilePipe
from spheretwin.viz.recording.live import Viewer
from spheretwin.viz.recording.parts.log import log_lines
from spheretwin.viz.recording.parts.part import Subject
from spheretwin.viz.recording.parts.registry import PARTS
from spheretwin.viz.scene.meshes import read_meshes

# Chunks handed over and not yet recorded; beyond these a run waits for its recorder, so that a long one
# does not gather in memory.
PENDING_CHUNKS = 3

# Rerun keeps some bytes of each chunk to the end of a recording. Chunks therefore grow with it, up to this.
MOST_ROWS = 12_288


class Recorder:
    """Takes a run's telemetry chunk by chunk and streams it to Rerun.

    Every signal is recorded at the rate of the control ticks, bit for bit; poses, coil colours and traces
    at 60 Hz. The file appears under its name when the recording closes; until then it is hidden, under a
    name of its own that ends in ``.part``.

    All work is done by one thread beside the simulation, which leaves the interpreter free while its
    compiled loop runs. What goes wrong there ends the recording and is raised by `close`, so that the run
    itself goes on.

    Parameters
    ----------
    actuator : Actuator
        Drawn; has as many groups as the telemetry has currents.
    signals : tuple of Signal
        Columns of the telemetry.
    facts : RunFacts
        For the text panel, the axes and the drawing.
    path : Path, optional
        Recording to write.
    live : bool
        Serve a viewer on 127.0.0.1.
    shown : str
        The view that is open at first, one of `VIEWS`.

    Raises
    ------
    InputError
        A mesh of the model cannot be read, or no file can be put at `path`; nothing is left there.
    """

    def __init__(
        self,
        actuator: Actuator,
        signals: tuple[Signal, ...],
        facts: RunFacts,
        *,
        path: Path | None = None,
        live: bool = False,
        shown: str = OVERVIEW,
    ) -> None:
        rr.set_strict_mode(True)  # otherwise a mistake is a warning, and its data are dropped
        subject = Subject(actuator, signals, facts, live, shown, uuid4().hex)
        read_meshes(facts.mjcf)  # a run needs no mesh, and would find out only now that one is missing
        self._path = path
        self._parts = [part(subject) for part in PARTS]
        self._handed_over = 0
        self._waiting: list[Table] = []
        self._recording = rr.RecordingStream(application(subject.view))
        self._recording.set_log_time_enabled(False)  # simulated time is the only one that means anything
        self._output = OutputFile(path) if path else None
        self._pipe = _pipe_to(self._output) if self._output and PIPE_PATHS.is_dir() else None
        self.viewer = Viewer() if live else None
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="recorder")
        self._room = Semaphore(PENDING_CHUNKS)
        self._fault: str | None = None
        self._closed = False
        self._submit(self._connect, subject.view)

    def _connect(self, view: View) -> None:
        """Open the sinks, log all that stays the same, then let a viewer in."""
        sinks: list[Any] = []
        if self._output:
            sinks.append(rr.FileSink((self._pipe or self._output).path))
        if self.viewer:
            sinks.append(self.viewer.sink)
        self._recording.set_sinks(*sinks, default_blueprint=opening_layout(view))
        for part in self._parts:
            part.begin(self._recording)
        if self.viewer:
            self.viewer.start()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def write(self, rows: Table) -> None:
        """Record the rows of one chunk, which must not change any more; wait while many are pending."""
        if not len(rows):
            return
        if self._waiting and rows.signals != self._waiting[-1].signals:
            self._hand_over()
        self._waiting.append(rows)
        due = 0 if self.viewer else min(self._handed_over // 4, MOST_ROWS)
        if sum(map(len, self._waiting)) >= due:
            self._hand_over()

    def note(self, t_s: float, text: str) -> None:
        """Record what happened before the tick at `t_s`."""
        self._hand_over()
        self._submit(log_lines, self._recording, [(t_s, Level.INFO, text)])

    def finish(self, status: Status) -> None:
        """Record how the run ended."""
        ending = named(status)  # a name that is none is told here, not in the recorder's thread
        self._hand_over()
        for part in self._parts:
            self._submit(part.finish, self._recording, ending)

    def close(self) -> None:
        """Complete the file and give it its name; end the live viewer. A second time does nothing.

        Raises
        ------
        SpheretwinError
            Some of the recording could not be made or written; what there is of it keeps ``.part``.
        """
        if self._closed:
            return
        self._closed = True
        self._hand_over()
        self._submit(self._recording.flush)
        self._worker.shutdown()
        self._recording.disconnect()
        if self._pipe:
            self._pipe.close()
        if self.viewer:
            self.viewer.close()
        if self._pipe and self._pipe.error:
            self._fault = self._pipe.error.strerror or f"{self._pipe.error!r}"
        if self._fault and self._output:
            raise SpheretwinError(
                f"recording: {self._path} could not be completed, {self._fault};"
                f" what there is of it is in {self._output.path}"
            )
        if self._fault:
            raise SpheretwinError(f"recording: live view: {self._fault}")
        if self._output:
            self._keep(self._output)

    def _keep(self, output: OutputFile) -> None:
        try:
            output.keep()
        except SpheretwinError as error:
            raise SpheretwinError(f"{error}; the recording is in {output.path}") from None

    def _hand_over(self) -> None:
        """Give what is waiting to the worker as one chunk."""
        if not self._waiting:
            return
        waiting, self._waiting = self._waiting, []
        rows = Table(waiting[0].signals, np.concatenate([table.values for table in waiting]))
        self._handed_over += len(rows)
        self._submit(self._write, rows)

    def _submit(self, work: Callable[..., None], *arguments: Any) -> None:
        self._room.acquire()
        self._worker.submit(self._perform, work, *arguments)

    def _perform(self, work: Callable[..., None], *arguments: Any) -> None:
        """Do one piece of work, unless one before it has failed."""
        try:
            if not self._fault:
                work(*arguments)
        except BaseException as error:  # a panic inside Rerun is no `Exception`
            self._fault = without_breaks(error) or type(error).__name__
        finally:
            self._room.release()

    def _write(self, rows: Table) -> None:
        for part in self._parts:
            part.write(self._recording, rows)
        if not self.viewer:
            self._recording.flush()  # encode it here, beside the loop, rather than all at the end


def _pipe_to(output: OutputFile) -> FilePipe:
    try:
        return FilePipe(output.path)
    except OSError as error:
        output.discard()
        raise InputError(f"output: expected a writable path, {error}") from None
