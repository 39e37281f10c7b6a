"""Changes of columns of telemetry, and the faults of a run: start, end and detection of each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.table import Table

FAULT, GROUP_OUT, TIME_TO_DETECTION = "fault", "group_out", "time_to_detection_s"
"""Columns of runs with faults: mode of each part, state of each group for the controller, and its delay."""

REPORTED = 1
"""State of a group that is out because its fault was reported."""


@dataclass
class FaultRecord:
    """One fault of one part."""

    part: str
    mode: str
    start_s: float
    end_s: float | None = None
    """End; None while the fault continues."""
    detection: str = "not detected"
    """Report to the controller, or detection by it with the delay."""

    def text(self) -> str:
        """Return part, mode, times and detection on one line."""
        end = "" if self.end_s is None else f" to {self.end_s:.3g} s"
        return f"{self.part} {self.mode} from {self.start_s:.3g} s{end}, {self.detection}"


class FaultLog:
    """Collector of the faults of a run.

    Attributes
    ----------
    faults : list of FaultRecord
        In the order of their starts.
    """

    def __init__(self) -> None:
        self.faults: list[FaultRecord] = []
        self._active: dict[int, FaultRecord] = {}
        self._changes = ColumnChanges()

    def write(self, rows: Table) -> None:
        """Add the rows of one chunk."""
        signals = {signal.name: signal for signal in rows.signals}
        if not len(rows) or FAULT not in signals:
            return
        labels, modes = signals[FAULT].labels, signals[FAULT].states
        for _, t_s, part, mode in self._changes.of(rows, FAULT):
            if ended := self._active.pop(part, None):
                ended.end_s = t_s
            if mode:
                self._active[part] = FaultRecord(labels[part], modes[mode], t_s)
                self.faults.append(self._active[part])
        for tick, t_s, group, state in self._changes.of(rows, GROUP_OUT):
            started = [
                fault for fault in self.faults if _group_of(fault.part) == group and fault.start_s <= t_s
            ]
            if state and started:
                delay_s = rows[TIME_TO_DETECTION][tick, group]
                is_reported = state == REPORTED or delay_s < 0
                detection = f"detected after {1e3 * delay_s:.3g} ms"
                started[-1].detection = "reported to the controller" if is_reported else detection

    def note(self, t_s: float, text: str) -> None:
        """Ignore a message: the rows contain every fault."""

    def finish(self, status: str) -> None:
        """Ignore the end of the run."""


def _group_of(part: str) -> int | None:
    """Return the group of a part such as ``coil.07``; None for a part of no group."""
    number = part.partition(".")[2]
    return int(number) if number.isdecimal() else None


class Transition(NamedTuple):
    """Change of one entry of a column of states."""

    tick: int
    """Row of the chunk."""
    t_s: float
    entry: int
    state: int
    """New state."""


class ColumnChanges:
    """Detector of the changes of columns; before the first row every state is 0."""

    def __init__(self) -> None:
        self._last: dict[str, NDArray[np.float64]] = {}

    def of(self, rows: Table, name: str) -> list[Transition]:
        """Return the changes of a column in one chunk, at least one row, in the order of time."""
        values = rows[name].reshape(len(rows), -1)
        last = self._last.get(name, np.zeros(values.shape[1]))
        self._last[name] = values[-1].copy()
        before = np.concatenate([last[None], values[:-1]])
        return [
            Transition(int(tick), float(rows["t_s"][tick]), int(entry), int(values[tick, entry]))
            for tick, entry in zip(*np.nonzero(values != before), strict=True)
        ]
