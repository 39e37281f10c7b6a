"""Stream of a run's telemetry to Rerun: the parts of a recording, made in a separate thread."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from threading import Lock, Semaphore
from types import TracebackType
from typing import Any

import numpy as np
import rerun as rr

from spheretwin.models.base.errors import without_breaks
from spheretwin.models.telemetry.status import Event, Level, Status, named
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.decimation import RowSelection
from spheretwin.viz.recording.currents import CoilCurrents
from spheretwin.viz.recording.part import RecordingPart, RecordingSubject, RowSet
from spheretwin.viz.recording.plots import PhasePlane, PlotData
from spheretwin.viz.recording.scene3d import Ending, MovingActuator, Torques, Traces
from spheretwin.viz.recording.signals import ScenarioText, Signals
from spheretwin.viz.recording.status import EventLog, LimitLanes, StateLanes

PARTS: tuple[type[RecordingPart], ...] = (
    ScenarioText,
    Signals,
    MovingActuator,
    Traces,
    Torques,
    Ending,
    StateLanes,
    LimitLanes,
    EventLog,
    CoilCurrents,
    PhasePlane,
    PlotData,  # the last: when a run has ended it sends the layout
)


def parts_of_run(subject: RecordingSubject) -> list[RecordingPart]:
    """Return the parts of a recording of a run, or of its live view."""
    return [part(subject) for part in PARTS if part.in_live_view or not subject.live]


# Chunks handed over and not yet recorded; beyond these a run waits for its recorder, so that a long one
# does not gather in memory.
PENDING_CHUNKS = 3

PATIENCE_s = 2.0
"""Time for which a process that ends waits for its recording."""


class Stream(ABC):
    """Receives a run's telemetry chunk by chunk, and makes its recording in a separate thread.

    The thread leaves the interpreter free while the compiled loop runs. An error in it ends the
    recording and is reported when the recording closes; the run itself continues.

    Parameters
    ----------
    subject : RecordingSubject
    parts : sequence of RecordingPart
        Write the recording, in this order.
    application : str
        Application id: a viewer keeps one layout for each.
    row_selection : RowSelection, optional
        Selects the rows for the parts that do not need all.

    Attributes
    ----------
    recording : rr.RecordingStream
        Recording that the parts write.
    fault : str or None
        Error of the thread.
    rows_handed_over : int
        To the thread, so far.

    Raises
    ------
    InputError
        A mesh of the model cannot be read.
    """

    def __init__(
        self,
        subject: RecordingSubject,
        parts: Sequence[RecordingPart],
        application: str,
        row_selection: RowSelection | None = None,
    ) -> None:
        rr.set_strict_mode(True)  # otherwise a mistake is a warning, and its data are dropped
        _ = subject.meshes  # a run needs none; a missing one is reported before there is a file
        self.recording = rr.RecordingStream(application)
        self.recording.set_log_time_enabled(False)  # simulated time is the only one that means anything
        self.fault: str | None = None
        self.rows_handed_over = 0
        self._parts, self._row_selection = parts, row_selection or RowSelection()
        self._waiting: list[Table] = []
        self._closed = False
        self._handing_over = Lock()
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="recorder")
        self._room = Semaphore(PENDING_CHUNKS)

    @abstractmethod
    def connect(self) -> None:
        """Set the destination of the recording, before any data."""

    @abstractmethod
    def is_due(self, waiting: Sequence[Table]) -> bool:
        """Return True if the waiting rows are recorded now, together."""

    @abstractmethod
    def send(self) -> None:
        """Send the data recorded since the last call."""

    @abstractmethod
    def complete(self) -> None:
        """Close the destination of the recording, after all data.

        Raises
        ------
        SpheretwinError
            Some of the recording could not be made or saved.
        """

    def __enter__(self) -> Stream:
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
        if self.is_due(self._waiting):
            self._hand_over()

    def note(self, t_s: float, text: str) -> None:
        """Record what happened before the tick at `t_s`."""
        self._hand_over()
        self._submit(self._note, (t_s, Level.INFO, text))

    def finish(self, status: Status) -> None:
        """Record how the run ended."""
        ending = named(status)  # an invalid name is refused here, not in the recorder's thread
        self._hand_over()
        self._submit(self._finish, ending)

    def close(self) -> None:
        """Complete the recording. A second call does nothing.

        Raises
        ------
        SpheretwinError
            Some of it could not be made or saved.
        """
        if self._closed:
            return
        self._closed = True
        self._hand_over()
        self._submit(self._write_rest)
        self._worker.shutdown()
        self.complete()

    def begin(self) -> None:
        """Let the thread record the static data first."""
        self._submit(self._begin)

    def _hand_over(self) -> None:
        """Give the waiting rows to the worker as one chunk."""
        with self._handing_over:
            if not self._waiting:
                return
            waiting, self._waiting = self._waiting, []
            self.rows_handed_over += sum(map(len, waiting))
            self._submit(self._write, waiting)

    def flush(self, timeout_s: float = PATIENCE_s) -> None:
        """Record the rows that wait. For a process that ends at once: any thread may call it."""
        with suppress(RuntimeError, TimeoutError):  # the worker is shut down, as all is recorded, or is slow
            self._hand_over()
            self._submit(self._write_rest)
            self._worker.submit(int).result(timeout_s)

    def _submit(self, work: Callable[..., None], *arguments: Any) -> None:
        self._room.acquire()
        self._worker.submit(self._perform, work, *arguments)

    def _perform(self, work: Callable[..., None], *arguments: Any) -> None:
        """Do one piece of work, unless one before it has failed."""
        try:
            if not self.fault:
                work(*arguments)
        except BaseException as error:  # a panic inside Rerun is no `Exception`
            self.fault = without_breaks(error) or type(error).__name__
        finally:
            self._room.release()

    def _begin(self) -> None:
        self.connect()
        for part in self._parts:
            part.begin(self.recording)
        self.send()

    def _write(self, tables: list[Table]) -> None:
        self.recording.flush()  # Rerun's threads have encoded the chunk before: no more than one waits
        rows = Table(tables[0].signals, np.concatenate([table.values for table in tables]))
        self._write_selected(self._row_selection.add(rows))
        for part in self._parts:
            if part.rows == RowSet.ALL:
                part.write(self.recording, rows)
        self.send()

    def _note(self, event: Event) -> None:
        for part in self._parts:
            part.note(self.recording, event)

    def _write_rest(self) -> None:
        self._write_selected(self._row_selection.flush())
        for part in self._parts:
            part.close(self.recording)
        self.send()
        self.recording.flush()

    def _write_selected(self, selected: list[Table]) -> None:
        for rows in selected:
            for part in self._parts:
                if part.rows == RowSet.SELECTED:
                    part.write(self.recording, rows)

    def _finish(self, ending: Status) -> None:
        self._write_selected(self._row_selection.flush())
        for part in self._parts:
            part.finish(self.recording, ending)
        self.send()
