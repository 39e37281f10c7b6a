"""Status of a run: one row for each status, with the code of the compiled loop and the log text."""

from __future__ import annotations

from enum import StrEnum

import numpy as np

from spheretwin.models.base.errors import unknown_name
from spheretwin.models.telemetry.fault_log import FAULT, GROUP_OUT, REPORTED, TIME_TO_DETECTION, ColumnChanges
from spheretwin.models.telemetry.table import Table, rank_lost, saturated


class Level(StrEnum):
    """Level of a log line."""

    INFO = "INFO"
    WARN = "WARN"
    ERROR = "ERROR"


class Status(StrEnum):
    """Present or final status of a run; equal to its own name as text.

    Attributes
    ----------
    level : Level
        Level of the log line.
    text : str
        Text of the log line.
    code : int or None
        Code that the loop returns; None if the loop cannot return it.
    """

    level: Level
    text: str
    code: int | None

    def __new__(cls, name: str, level: Level, text: str, code: int | None = None) -> Status:
        """Create a name with its level, text and code."""
        status = str.__new__(cls, name)
        status._value_ = name
        status.level, status.text, status.code = level, text, code
        return status

    RUNNING = "running", Level.INFO, "the run goes on", 0
    COMPLETED = "completed", Level.INFO, "the run is complete"
    LEFT_WORKSPACE = (
        "left_workspace",
        Level.ERROR,
        "a hinge reached the end of its range: the run ends here",
        1,
    )
    DIVERGED = (
        "diverged",
        Level.ERROR,
        "a torque or the motion lost its number or its bounds: the run ends here",
        2,
    )
    FAILSAFE = "failsafe", Level.ERROR, "the amplifiers were switched off for safety: the run ends here", 3
    INTERRUPTED = "interrupted", Level.WARN, "the run was interrupted", 4


BY_CODE = {status.code: status for status in Status if status.code is not None}
"""Status by the code of the loop."""


def named(name: str) -> Status:
    """Return the status of a name.

    Raises
    ------
    InputError
        No status has this name.
    """
    for status in Status:
        if status == name:
            return status
    raise unknown_name("status", name, Status, "one of {}")


Event = tuple[float, Level, str]
"""Simulated time in s, level, text."""

# Chattering currents reach the limit for single ticks; pauses shorter than this are within one event.
QUIET_S = 0.1

RANK_LOST = "rank lost: the groups in use give no torque in one direction, and no currents are commanded"


FAILSAFE_REASON = "failsafe_reason"
"""Column of runs with a watchdog: number of the reason of its trip."""


class Events:
    """Detector of the events of a run in its telemetry, chunk by chunk: limits, faults, trips.

    A fault is a warning from its start: nothing in the run has answered it yet.
    """

    def __init__(self) -> None:
        self._now_s = 0.0
        self._last_saturated_s = self._last_lost_s = -np.inf
        self._changes = ColumnChanges()

    def of(self, rows: Table) -> list[Event]:
        """Return the events of one chunk."""
        t, scale = rows["t_s"], rows["allocation_scale"]
        events = self._faults_of(rows)
        for i in np.flatnonzero(rank_lost(rows)):
            if t[i] - self._last_lost_s > QUIET_S:
                events.append((float(t[i]), Level.WARN, RANK_LOST))
            self._last_lost_s = t[i]
        for i in np.flatnonzero(saturated(rows)):
            if t[i] - self._last_saturated_s > QUIET_S:
                message = f"current limit reached: {100 * scale[i]:.0f} % of the commanded torque"
                events.append((float(t[i]), Level.WARN, message))
            self._last_saturated_s = t[i]
        self._now_s = float(t[-1])
        return sorted(events, key=lambda event: event[0])

    def _faults_of(self, rows: Table) -> list[Event]:
        """Return faults, groups that are switched off, and trips of the watchdog."""
        signals = {signal.name: signal for signal in rows.signals}
        events: list[Event] = []
        if FAULT in signals:
            parts, modes = signals[FAULT].labels, signals[FAULT].states
            for _, t_s, part, mode in self._changes.of(rows, FAULT):
                level = Level.WARN if mode else Level.INFO
                events.append((t_s, level, f"{parts[part]} {modes[mode] if mode else 'works again'}"))
            delays, states = rows[TIME_TO_DETECTION], signals[GROUP_OUT].states
            for tick, t_s, group, out in self._changes.of(rows, GROUP_OUT):
                after_s = delays[tick, group]
                after = f", {1e3 * after_s:.0f} ms after it failed" if out > REPORTED and after_s >= 0 else ""
                events.append((t_s, Level.INFO, f"group {group} {states[out]}{after}"))
        if FAILSAFE_REASON in signals:
            reasons = signals[FAILSAFE_REASON].states
            for _, t_s, _, reason in self._changes.of(rows, FAILSAFE_REASON):
                events.append((t_s, Level.ERROR, f"watchdog: {reasons[reason]}"))
        return events

    def end(self, status: Status) -> Event:
        """Return the event of the end of the run."""
        return self._now_s, status.level, status.text
