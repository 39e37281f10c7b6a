"""Outputs of a run: files and live view, opened before and closed after it, independent of each other."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.base.extras import check_recordings
from spheretwin.models.base.files import check_writable
from spheretwin.models.telemetry.parquet import TelemetryFile
from spheretwin.models.telemetry.run_record import RunFacts, RunRecord
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Sink, Table
from spheretwin.records.provenance import facts_of, record_of
from spheretwin.session import Session
from spheretwin.viz.layout.view import LIVE_WINDOW_S, OVERVIEW

if TYPE_CHECKING:
    from spheretwin.viz.recording.live import LiveView
    from spheretwin.viz.recording.recorder import Recorder


def check(record: Path | None, telemetry: Path | None, logs: Sequence[Path] = ()) -> None:
    """Check before a run that its files can be written.

    Parameters
    ----------
    record, telemetry : Path, optional
        Recording of Rerun, ``.rrd``, and table of columns, ``.parquet``.
    logs : sequence of Path
        Further files, which others check.

    Raises
    ------
    InputError
        A file cannot be written, its name is that of another format, or two paths are equal.
    """
    if record:
        check_recordings("output")
        check_writable(record, ".rrd")
    if telemetry:
        check_writable(telemetry, ".parquet")
    paths = [path for path in (record, telemetry, *logs) if path]
    places = [path.resolve() for path in paths]
    for path, place in zip(paths, places, strict=True):
        if places.count(place) > 1:
            raise InputError(f"output: expected a separate path for each file, received {path} twice")


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
    first_tick : int, optional
        Tick of the first row of the files; None: `begin` states it later.
    live_window_s : float
        Time before the present that the plots of the live view show.
    replay_of : str
        Name of the file whose run is replayed.

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
        live: bool = False,
        view: str = OVERVIEW,
        record_rate_Hz: float | None = None,
        first_tick: int | None = 0,
        live_window_s: float = LIVE_WINDOW_S,
        replay_of: str = "",
    ) -> None:
        self._session = session
        self.record, self.telemetry = record, telemetry
        check(record, telemetry)
        self._file: TelemetryFile | None = None
        facts = replace(facts_of(session.initial_scenario), replay_of=replay_of)
        self._live = _live_view(session, facts, view, live_window_s) if live else None
        # The recorder last: it would leave a file if another output were refused.
        try:
            self._recorder = (
                _recorder_at_rate(session, facts, record, view, record_rate_Hz) if record else None
            )
        except SpheretwinError:
            if self._live:
                self._live.close()
            raise
        if first_tick is not None:
            self.begin(first_tick)

    @property
    def paths(self) -> list[Path]:
        """Files to write; after `close` those that were written completely."""
        return [path for path in (self.record, self.telemetry) if path]

    def begin(self, first_tick: int, start: RunRecord | None = None) -> None:
        """Open the telemetry.

        Parameters
        ----------
        first_tick : int
            Tick of the first row of the files; earlier rows are skipped.
        start : RunRecord, optional
            Record of the run at its start; default: computed now.
        """
        self._first_tick, self._skipped = first_tick, first_tick - self._session.tick
        if self.telemetry:
            self._start = record_of(self._session, start, first_tick)
            self._file = TelemetryFile(self.telemetry, self._session.signals, self._start.metadata())

    @property
    def sinks(self) -> list[Sink]:
        """Sinks of the telemetry."""
        sinks: list[Sink] = [sink for sink in (self._file, self._recorder, self._live) if sink]
        if not self._skipped:
            return sinks
        first_s = (self._first_tick - 0.5) * self._session.scenario.controller.period_s
        return [_FromTick(self._skipped, first_s, sink) for sink in sinks]

    def facts(self) -> dict[str, str]:
        """Return the metadata of the telemetry at this time."""
        return record_of(self._session, self._start, self._first_tick).metadata() if self._file else {}

    def close(self, facts: dict[str, str] | None = None) -> list[SpheretwinError]:
        """Complete every file; return the errors.

        Parameters
        ----------
        facts : dict, optional
            Metadata of the telemetry, from `facts`; default: the metadata at this time.
        """
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
                self._file.close(self.facts() if facts is None else facts)
            except SpheretwinError as error:
                errors.append(error)
                self.telemetry = None
        return errors


class _FromTick:
    """Passes the rows from a tick on, and the notes from a time on, to a sink."""

    def __init__(self, skipped: int, first_s: float, sink: Sink) -> None:
        self._remaining, self._first_s, self._sink = skipped, first_s, sink

    def write(self, rows: Table) -> None:
        skipped = min(self._remaining, len(rows))
        self._remaining -= skipped
        if skipped < len(rows):
            self._sink.write(rows.rows(skipped, len(rows)))

    def note(self, t_s: float, text: str) -> None:
        if t_s > self._first_s:  # a chunk may have faults on both sides of the first tick
            self._sink.note(t_s, text)

    def finish(self, status: Status) -> None:
        self._sink.finish(status)


def _live_view(session: Session, facts: RunFacts, view: str, window_s: float) -> LiveView:
    check_recordings("live view")
    from spheretwin.viz.recording.live import LiveView  # Rerun is slow to import

    live = LiveView(session.actuator, session.signals, facts, shown=view, window_s=window_s)
    print(f"watch: {live.address}", file=sys.stderr, flush=True)
    return live


def _recorder_at_rate(
    session: Session, facts: RunFacts, path: Path, view: str, rate_Hz: float | None
) -> Recorder:
    check_recordings("output")
    from spheretwin.viz.recording.recorder import Recorder  # Rerun is slow to import

    return Recorder(session.actuator, session.signals, facts, path=path, shown=view, rate_Hz=rate_Hz)
