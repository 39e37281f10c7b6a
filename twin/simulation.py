"""One run of a scenario to its end: a session, advanced chunk by chunk, and whoever follows it."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.law import Law
from spheretwin.faults.fault_injector import FaultMessages
from spheretwin.models.telemetry.run_record import Change
from spheretwin.models.telemetry.signals import width
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table, TelemetryBuffer, allocated
from spheretwin.provenance import change_text, record_of
from spheretwin.run import Run
from spheretwin.scenario import load
from spheretwin.scenario.changes import with_change
from spheretwin.scenario.sections import Scenario
from spheretwin.session import Session
from spheretwin.trajectories.trajectory import Sampled

# Long enough to make the calls between chunks cheap, short enough for a progress bar and for Ctrl-C.
CHUNK_STEPS = 2000
LIVE_CHUNK_S = 0.02


class Sink(Protocol):
    """Whatever follows a run while it goes on: a recorder, a progress bar, a file."""

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, which do not change any more."""

    def note(self, t_s: float, text: str) -> None:
        """Take note of what happened before the tick at `t_s`."""

    def finish(self, status: Status) -> None:
        """Take note of how the run ended."""


def simulate(
    scenario: Scenario | str | Path,
    changes: Mapping[str, Any] | None = None,
    *,
    law: Law | None = None,
    sinks: Sequence[Sink] = (),
    trajectory: Sampled | None = None,
) -> Run:
    """Run a scenario to its end.

    Parameters
    ----------
    scenario : Scenario or str or Path
        From `scenario.load`, built in Python, the name of a shipped one, or the path of a TOML file.
    changes : mapping, optional
        Values by dotted name, such as ``{"controller.law": "pd"}``.
    law : Law, optional
        Runs instead of the law that the scenario names.
    sinks : sequence of Sink
        Handed the telemetry while the run goes on.
    trajectory : object with ``sample(t)``, optional
        Followed instead of the trajectory that the scenario names.

    Raises
    ------
    InputError
        The model file, the torque curve, the law or a value of the scenario cannot be used, or the telemetry
        does not fit in memory.
    """
    scenario = _scenario(scenario, changes or {})
    with Session(scenario, law, trajectory) as session:
        record = record_of(session)  # with the digests of the files when the run starts
        if scenario.event:  # which may change the columns
            kept = TelemetryBuffer(session.signals, scenario.ticks)
            status = follow(session, scenario.ticks, [kept, *sinks])
            telemetry = kept.table
        else:
            log = allocated(scenario.ticks, width(session.signals))
            status = follow(session, scenario.ticks, sinks, log=log)
            telemetry = Table(session.signals, log[: session.tick])
        return Run(
            session.begun_as,
            status,
            telemetry,
            session.loop_s,
            session.actuator,
            session.law_error,
            replace(record, ticks=session.tick),
        )


def _scenario(given: Scenario | str | Path, changes: Mapping[str, Any]) -> Scenario:
    if not isinstance(given, Scenario):
        return load(os.fspath(given), changes)
    for dotted, value in changes.items():
        given = with_change(given, dotted, value)
    return given


def follow(
    session: Session,
    ticks: int,
    sinks: Iterable[Sink],
    *,
    log: NDArray[np.float64] | None = None,
    journal: Sequence[Change] = (),
    live: bool = False,
    stop_requested: Callable[[], bool] = lambda: False,
) -> Status:
    """Advance a session to a tick, and hand every chunk on.

    Parameters
    ----------
    session : Session
        At tick 0, or further on.
    ticks : int
        Where to end.
    sinks : iterable of Sink
        Each is handed the telemetry chunk by chunk, in memory of its own.
    log : (ticks, width) array, optional
        Where to keep the rows; not kept unless given.
    journal : sequence of Change
        Changes to make on the way, each before its tick.
    live : bool
        Keep pace with the clock, in chunks of 20 ms.
    stop_requested : callable
        Asked between chunks; True ends the run with the status ``interrupted``.

    Returns
    -------
    Status
        How the run ended.

    Raises
    ------
    InputError
        Reference or disturbance would be lost on the way; a change of the journal is none.
    """
    sinks, waiting = list(sinks), list(journal)
    session.check_horizon(_known_to(ticks, waiting))
    chunk = _chunk_ticks(session.scenario, live)
    started, first = time.perf_counter(), session.t_s
    noted, told = _note_events(session, 0, sinks), FaultMessages()
    while session.tick < ticks and not session.ended and not stop_requested():
        _make(session, ticks, waiting, sinks)
        last = min(session.tick + chunk, ticks, *(change.tick for change in waiting[:1]))
        rows = _advance(session, last, log)
        lines = told.of(rows)
        for sink in sinks:
            sink.write(rows)
            for t_s, text in lines:
                sink.note(t_s, text)
        noted = _note_events(session, noted, sinks)
        if live:
            _sleep_until(started + session.t_s - first)
    _make(session, ticks, waiting, sinks)  # what came after the last tick is in the journal too
    status = session.status
    if status == Status.RUNNING:
        status = Status.COMPLETED if session.tick >= ticks else Status.INTERRUPTED
    for sink in sinks:
        sink.finish(status)
    return status


def _note_events(session: Session, noted: int, sinks: Sequence[Sink]) -> int:
    """Tell of the events made since then; returns how many there have been."""
    for change in session.events[noted:]:
        for sink in sinks:
            sink.note(change.tick * session.scenario.controller.period_s, change_text(change))
    return len(session.events)


def _known_to(ticks: int, waiting: Sequence[Change]) -> int:
    """Tick up to which reference and disturbance are those of the present scenario."""
    return min([ticks, *(change.tick for change in waiting)])


def _make(session: Session, ticks: int, waiting: list[Change], sinks: Sequence[Sink]) -> None:
    """Make the changes whose tick has come, and wait for them no more."""
    while waiting and waiting[0].tick <= session.tick:
        change = waiting.pop(0)
        session.set(change.name, change.value)
        for sink in sinks:
            sink.note(session.t_s, change_text(change))
        if session.tick < _known_to(ticks, waiting):
            session.check_horizon(_known_to(ticks, waiting))


def _advance(session: Session, last: int, log: NDArray[np.float64] | None) -> Table:
    first = session.tick
    if log is None:
        return session.advance(last - first)
    rows = log[first:last]
    return Table(session.signals, rows[: session.advance_into(rows)])


def _chunk_ticks(scenario: Scenario, live: bool) -> int:
    if live:
        return max(1, round(LIVE_CHUNK_S / scenario.controller.period_s))
    return max(1, CHUNK_STEPS // scenario.substeps)


def _sleep_until(moment: float) -> None:
    time.sleep(max(0.0, moment - time.perf_counter()))
