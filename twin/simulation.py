"""Simulation of a scenario to its end: a session, advanced chunk by chunk, and the sinks of its telemetry."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.law import Law
from spheretwin.models.telemetry.run_record import Change
from spheretwin.models.telemetry.signals import width
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Sink, Table, TelemetryBuffer, allocated
from spheretwin.records.provenance import change_text, record_of
from spheretwin.run import Run
from spheretwin.scenario import scenario_of
from spheretwin.scenario.sections import Scenario
from spheretwin.session import Session
from spheretwin.trajectories.trajectory import Sampled

# Long enough to make the calls between chunks cheap, short enough for a progress bar and for Ctrl-C.
CHUNK_STEPS = 2000
LIVE_CHUNK_S = 0.02


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
        From `scenario.load` or built in Python; the name of a shipped scenario or the path of a TOML file.
    changes : mapping, optional
        Values by dotted name, such as ``{"controller.law": "pd"}``.
    law : Law, optional
        Replaces the law of the scenario.
    sinks : sequence of Sink
        Receive the telemetry while the run runs.
    trajectory : object with ``sample(t)``, optional
        Replaces the trajectory of the scenario.

    Raises
    ------
    InputError
        The model file, the torque curve, the law or a value of the scenario cannot be used, or the telemetry
        does not fit in memory.
    """
    scenario = scenario_of(scenario, changes)
    with Session(scenario, law, trajectory) as session:
        record = record_of(session)  # now: with the digests of the files at the start
        run = run_session(session, sinks)
    return replace(run, record=replace(record, ticks=len(run.telemetry)))


def run_session(session: Session, sinks: Sequence[Sink] = ()) -> Run:
    """Run a session from tick 0 to the end of its scenario; the result has no record.

    Parameters
    ----------
    session : Session
    sinks : sequence of Sink
        Receive the telemetry while the run runs.

    Raises
    ------
    InputError
        As `simulate`.
    """
    scenario = session.initial_scenario
    if scenario.event:  # an event may change the columns
        buffer = TelemetryBuffer(session.signals, scenario.ticks)
        status = follow(session, scenario.ticks, [buffer, *sinks])
        telemetry = buffer.table
    else:
        log = allocated(scenario.ticks, width(session.signals))
        status = follow(session, scenario.ticks, sinks, log=log)
        telemetry = Table(session.signals, log[: session.tick])
    return Run(scenario, status, telemetry, session.loop_s, session.actuator, session.law_error)


def follow(
    session: Session,
    ticks: int,
    sinks: Iterable[Sink],
    *,
    log: NDArray[np.float64] | None = None,
    journal: Sequence[Change] = (),
    live: bool = False,
    short_chunks: bool = False,
    stop_requested: Callable[[], bool] = lambda: False,
) -> Status:
    """Advance a session to a tick, and pass every chunk to the sinks.

    Parameters
    ----------
    session : Session
        Session at tick 0 or at a later tick.
    ticks : int
        Last tick.
    sinks : iterable of Sink
        Each receives the telemetry chunk by chunk.
    log : (ticks, width) array, optional
        Result: the rows of the telemetry.
    journal : sequence of Change
        Changes during the run, each applied before its tick.
    live : bool
        True for the pace of the clock, in chunks of 20 ms.
    short_chunks : bool
        True for chunks of 20 ms without the pace of the clock: an external part has its own.
    stop_requested : callable
        Called between chunks; True ends the run with the status ``interrupted``.

    Returns
    -------
    Status
        Final status.

    Raises
    ------
    InputError
        Reference or disturbance is not finite during the run, or a change of the journal is invalid.
    """
    sinks, pending = list(sinks), list(journal)
    session.check_horizon(_known_to(ticks, pending))
    chunk = _chunk_ticks(session.scenario, live or short_chunks)
    session.compile()
    started, first = time.perf_counter(), session.t_s
    reported = _report_events(session, 0, sinks)
    while session.tick < ticks and not session.ended and not stop_requested():
        _apply_due(session, ticks, pending, sinks)
        last = min(session.tick + chunk, ticks, *(change.tick for change in pending[:1]))
        rows = _advance(session, last, log)
        for sink in sinks:
            sink.write(rows)
        reported = _report_events(session, reported, sinks)
        if live:
            sleep_until(started + session.t_s - first)
    _apply_due(session, ticks, pending, sinks)  # the journal also contains changes after the last tick
    status = session.status
    if status == Status.RUNNING:
        status = Status.COMPLETED if session.tick >= ticks else Status.INTERRUPTED
    for sink in sinks:
        sink.finish(status)
    return status


def _report_events(session: Session, reported: int, sinks: Sequence[Sink]) -> int:
    """Report the events after the first `reported` ones to the sinks; return the number of all events."""
    for change in session.events[reported:]:
        for sink in sinks:
            sink.note(change.tick * session.scenario.controller.period_s, change_text(change))
    return len(session.events)


def _known_to(ticks: int, pending: Sequence[Change]) -> int:
    """Return the tick up to which the present scenario determines reference and disturbance."""
    return min([ticks, *(change.tick for change in pending)])


def _apply_due(session: Session, ticks: int, pending: list[Change], sinks: Sequence[Sink]) -> None:
    """Apply the changes that are due, and remove them from the pending ones."""
    while pending and pending[0].tick <= session.tick:
        change = pending.pop(0)
        session.set(change.name, change.value)
        for sink in sinks:
            sink.note(session.t_s, change_text(change))
        if session.tick < _known_to(ticks, pending):
            session.check_horizon(_known_to(ticks, pending))


def _advance(session: Session, last: int, log: NDArray[np.float64] | None) -> Table:
    first = session.tick
    if log is None:
        return session.advance(last - first)
    rows = log[first:last]
    return Table(session.signals, rows[: session.advance_into(rows)])


def _chunk_ticks(scenario: Scenario, short: bool) -> int:
    if short:
        return max(1, round(LIVE_CHUNK_S / scenario.controller.period_s))
    return max(1, CHUNK_STEPS // scenario.substeps)


def sleep_until(moment: float) -> None:
    """Sleep until a time of `time.perf_counter`."""
    time.sleep(max(0.0, moment - time.perf_counter()))
