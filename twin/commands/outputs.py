"""Files and live view of a run: opened before it, closed after it, each whatever becomes of the other."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.base.files import check_writable
from spheretwin.models.telemetry.file import TelemetryFile
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.twin.records.facts import facts_of, record_of
from spheretwin.twin.session import Session
from spheretwin.twin.simulation import Sink

if TYPE_CHECKING:
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
    """

    def __init__(
        self,
        session: Session,
        record: Path | None,
        telemetry: Path | None,
        live: bool,
        first_tick: int = 0,
    ) -> None:
        self._session, self._first_tick = session, first_tick
        self.record, self.telemetry = record, telemetry
        self._file: TelemetryFile | None = None
        if telemetry:
            self._begun = record_of(session, first_tick=first_tick)
            self._file = TelemetryFile(telemetry, session.signals, self._begun.metadata())
        # The recorder last: it alone leaves something where it is made and another is refused.
        self._recorder = _recorder(session, record, live) if record or live else None

    @property
    def sinks(self) -> list[Sink]:
        """To be handed the telemetry."""
        sinks: list[Sink] = [sink for sink in (self._file, self._recorder) if sink]
        return [_From(self._first_tick, sink) for sink in sinks] if self._first_tick else sinks

    def close(self) -> list[SpheretwinError]:
        """Complete every file; returns what went wrong."""
        faults = []
        if self._recorder:  # first: its memory is free then
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


def _recorder(session: Session, path: Path | None, live: bool) -> Recorder:
    from spheretwin.viz.recording.recorder import Recorder  # Rerun is slow to import

    facts = facts_of(session.begun_as)
    recorder = Recorder(session.actuator, session.signals, facts, path=path, live=live)
    if recorder.viewer:
        print(f"watch: {recorder.viewer.address}", file=sys.stderr, flush=True)
    return recorder
