"""Signals whose values are states, as lanes of a timeline: one for each part that ever changes its state."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.telemetry.checksums import line_checksums
from spheretwin.models.telemetry.fault_log import ColumnChanges
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.status import QUIET_S, Event, Events, Level, Status
from spheretwin.models.telemetry.table import Table, rank_lost, saturated
from spheretwin.viz import theme
from spheretwin.viz.layout.view import EVENTS, LIMITS, RUN, shown_until_s
from spheretwin.viz.recording.part import (
    RecordingPart,
    RecordingSubject,
    checksums,
    drawable,
    nanoseconds,
    time_index,
    total,
)


class Lane(NamedTuple):
    """Changes of one part's state."""

    entity: str
    t_s: list[float]
    states: list[str]
    possible: tuple[str, ...]


class StateChanges:
    """Finds changes of states in a run's telemetry, chunk by chunk; before the first row all are 0."""

    def __init__(self) -> None:
        self._changes = ColumnChanges()

    def of(self, rows: Table) -> list[Lane]:
        """Return the lanes that have changes in one chunk, at least one row."""
        lanes: dict[str, Lane] = {}
        for signal in (signal for signal in rows.signals if signal.states):
            for _, t_s, entry, state in self._changes.of(rows, signal.name):
                lane = lanes.setdefault(name := _entity(signal, entry), Lane(name, [], [], signal.states))
                lane.t_s.append(t_s)
                lane.states.append(signal.states[state])
        return list(lanes.values())


def _entity(signal: Signal, place: int) -> str:
    names = [signal.name, *signal.labels[place : place + 1]]
    return "/".join(rr.escape_entity_path_part(name.replace(" ", "-")) for name in names)


class StateLanes(RecordingPart):
    """Lanes of a timeline."""

    def __init__(self, subject: RecordingSubject) -> None:
        super().__init__(subject)
        self._changes = StateChanges()
        self._styled: set[str] = set()

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the changes of a chunk."""
        for entity, t_s, states, possible in self._changes.of(rows):
            if entity not in self._styled:
                self._styled.add(entity)
                fine, *others = possible
                colours = [theme.FINE, *[theme.FAILURE] * len(others)]
                style = rr.StateConfiguration(values=[fine, *others], colors=colours)
                recording.log(entity, style, static=True)
            recording.send_columns(entity, time_index(np.array(t_s)), rr.StateChange.columns(state=states))


class EventLog(RecordingPart):
    """Lines of what the telemetry shows, and how the run ended."""

    def __init__(self, subject: RecordingSubject) -> None:
        super().__init__(subject)
        self._events = Events()
        self._lines = 0

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Log the events of a chunk."""
        self._log(recording, self._events.of(rows))

    def note(self, recording: rr.RecordingStream, event: Event) -> None:
        """Log an event that the rows do not show."""
        self._log(recording, [event])

    def finish(self, recording: rr.RecordingStream, status: Status) -> None:
        """Log how the run ended."""
        self._log(recording, [self._events.end(status)])

    def close(self, recording: rr.RecordingStream) -> None:
        """Log the number of lines."""
        recording.log(EVENTS, [total(self._lines)], static=True)

    def _log(self, recording: rr.RecordingStream, events: list[Event]) -> None:
        log_lines(recording, events, self._lines)
        self._lines += len(events)


def log_lines(recording: rr.RecordingStream, events: list[Event], first: int = 0) -> None:
    """Log some lines at their times.

    Parameters
    ----------
    recording : rr.RecordingStream
    events : list of Event
    first : int
        Number of the first of them.
    """
    if events:
        t_s, level, text = zip(*((t_s, level, drawable(text)) for t_s, level, text in events), strict=True)
        lines = rr.TextLog.columns(text=list(text), level=list(level))
        t_ns = nanoseconds(np.array(t_s)).tolist()
        sums = line_checksums(list(zip(t_ns, level, text, strict=True)), first)
        recording.send_columns(EVENTS, time_index(np.array(t_s)), [*lines, checksums(sums)])


WITHIN, VOLTAGE, CURRENT, RANK = LEVELS = (
    "within limits",
    *(f"{state}, pauses < {QUIET_S:g} s" for state in ("voltage at its limit", "saturated", "rank lost")),
)
"""From no limit to the most severe one; shorter pauses are not shown."""

Change = tuple[float, str]
"""Time in s, and the state from then on."""


class LimitSpells:
    """Finds the times at a limit, chunk by chunk; pauses shorter than `QUIET_S` are ignored."""

    def __init__(self) -> None:
        self._level = 0
        self._last_s = -np.inf
        self._free_s = 0.0  # of the first tick after the last one at a limit

    def of(self, rows: Table) -> list[Change]:
        """Return the changes that are certain after the rows of a chunk."""
        t_s, levels, changes = rows["t_s"], _levels(rows), []
        if self._free_s < self._last_s:  # the last row of the chunk before was at a limit
            self._free_s = float(t_s[0])
        for i in np.flatnonzero(levels):
            changes += self._end_before(t_s[i])
            if levels[i] > self._level:
                self._level = int(levels[i])
                changes.append((float(t_s[i]), LEVELS[self._level]))
            self._last_s = float(t_s[i])
            self._free_s = float(t_s[i + 1]) if i + 1 < len(t_s) else -np.inf
        return changes + self._end_before(t_s[-1])

    def _end_before(self, t_s: float) -> list[Change]:
        if not self._level or t_s - self._last_s <= QUIET_S:
            return []
        self._level = 0
        return [(self._free_s, WITHIN)]


def _levels(rows: Table) -> NDArray[np.int64]:
    """Return the most severe limit at each tick, as a place among `LEVELS`."""
    levels = np.zeros(len(rows), dtype=np.int64)
    if any(signal.name == "voltage_limited" for signal in rows.signals):
        levels[np.any(rows["voltage_limited"] > 0, axis=1)] = LEVELS.index(VOLTAGE)
    levels[saturated(rows)] = LEVELS.index(CURRENT)
    levels[rank_lost(rows)] = LEVELS.index(RANK)
    return levels


class LimitLanes(RecordingPart):
    """Logs both lanes."""

    def __init__(self, subject: RecordingSubject) -> None:
        super().__init__(subject)
        self._spells = LimitSpells()
        self._last_s = 0.0

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log colours, and how a run begins."""
        endings = {status.replace("_", " "): _colour(status) for status in Status}
        levels = dict(zip(LEVELS, (theme.FINE, theme.ESTIMATE, theme.WARNING, theme.FAILURE), strict=True))
        for lane, colours in ((RUN, endings), (LIMITS, levels)):
            states = rr.StateConfiguration(values=list(colours), colors=list(colours.values()))
            recording.log(lane, states, static=True)
        _log(recording, RUN, [(0.0, str(Status.RUNNING))])
        _log(recording, LIMITS, [(0.0, WITHIN)])

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the spells of a chunk."""
        self._last_s = float(rows["t_s"][-1])
        _log(recording, LIMITS, self._spells.of(rows))

    def finish(self, recording: rr.RecordingStream, status: Status) -> None:
        """Record how the run ended, where that is not as planned, and to the end of the time axes."""
        if status not in (Status.COMPLETED, Status.RUNNING):
            until_s = shown_until_s(self.subject.facts.duration_s, self._last_s)
            _log(recording, RUN, [(t_s, status.replace("_", " ")) for t_s in (self._last_s, until_s)])


def _colour(status: Status) -> theme.Colour:
    return {Level.INFO: theme.FINE, Level.WARN: theme.WARNING, Level.ERROR: theme.FAILURE}[status.level]


def _log(recording: rr.RecordingStream, lane: str, changes: list[Change]) -> None:
    if changes:
        t_s, states = zip(*changes, strict=True)
        recording.send_columns(lane, time_index(np.array(t_s)), rr.StateChange.columns(state=list(states)))
