"""What happened in a run, from its rows, its scenario and its journal; as its log has it."""

from __future__ import annotations

from collections.abc import Iterator

from spheretwin.models.telemetry.record import Change
from spheretwin.models.telemetry.status import Level
from spheretwin.twin.faults.told import FaultLines
from spheretwin.twin.review.journal import planned
from spheretwin.twin.review.run import Reviewed
from spheretwin.twin.simulation import change_told
from spheretwin.viz.recording.parts.events import Event, Events


def events(run: Reviewed) -> list[Event]:
    """Events of a run in the order of time, its end last: the same from either of its files."""
    ended = run.record.status
    if run.log:
        found, end = list(run.log[:-1] if ended else run.log), list(run.log[-1:] if ended else ())
    else:
        log = Events()
        found = log.of(run.every_tick) if len(run.table) else []
        found += [(t_s, Level.INFO, text) for t_s, text in FaultLines().of(run.every_tick)]
        found += [(each.tick * run.period_s, Level.INFO, change_told(each)) for each in _changes(run)]
        end = [log.end(ended)] if ended else []
    return [*sorted(found, key=lambda event: (event[0], event[2])), *end]


def _changes(run: Reviewed) -> Iterator[Change]:
    """Changes that its scenario planned and that it came to, and those that were made by hand."""
    yield from planned(run.record.scenario, run.period_s, len(run.every_tick))
    yield from run.record.journal
