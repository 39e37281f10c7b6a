"""Two lanes of states that every run has: whether it goes on, and whether a limit holds it back."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.telemetry.allocation import rank_lost, saturated
from spheretwin.models.telemetry.status import Level, Status
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import palette
from spheretwin.viz.layout.paths import STATES
from spheretwin.viz.layout.view import shown_until_s
from spheretwin.viz.recording.columns import time_index
from spheretwin.viz.recording.parts.events import QUIET_S
from spheretwin.viz.recording.parts.part import Part, Subject

RUN = f"{STATES}/run"
LIMITS = f"{STATES}/limits"

WITHIN, VOLTAGE, CURRENT, RANK = LEVELS = (
    "within limits",
    "voltage at its limit",
    "saturated",
    "rank lost",
)
"""From what holds nothing back to what holds back most."""

Change = tuple[float, str]
"""Time in s, and the state from then on."""


class Spells:
    """Finds when a run is at a limit, chunk by chunk: pauses shorter than `QUIET_S` are none."""

    def __init__(self) -> None:
        self._level = 0
        self._last_s = -np.inf
        self._free_s = 0.0  # of the first tick after the last one at a limit

    def of(self, rows: Table) -> list[Change]:
        """Changes that the rows of a chunk make sure of."""
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
    """What holds back most at each tick, as a place among `LEVELS`."""
    levels = np.zeros(len(rows), dtype=np.int64)
    if any(signal.name == "voltage_limited" for signal in rows.signals):
        levels[np.any(rows["voltage_limited"] > 0, axis=1)] = LEVELS.index(VOLTAGE)
    levels[saturated(rows)] = LEVELS.index(CURRENT)
    levels[rank_lost(rows)] = LEVELS.index(RANK)
    return levels


class Limits(Part):
    """Logs both lanes."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._spells = Spells()
        self._last_s = 0.0

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log colours, and how a run begins."""
        endings = {status.replace("_", " "): _colour(status) for status in Status}
        levels = dict(
            zip(LEVELS, (palette.FINE, palette.BELIEVED, palette.WARNING, palette.FAILURE), strict=True)
        )
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


def _colour(status: Status) -> palette.Colour:
    return {Level.INFO: palette.FINE, Level.WARN: palette.WARNING, Level.ERROR: palette.FAILURE}[status.level]


def _log(recording: rr.RecordingStream, lane: str, changes: list[Change]) -> None:
    if changes:
        t_s, states = zip(*changes, strict=True)
        recording.send_columns(lane, time_index(np.array(t_s)), rr.StateChange.columns(state=list(states)))
