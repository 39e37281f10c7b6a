"""What a log says of faults: when parts fail and work again, when groups are left out, why a run stops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.supervision.groups import STATES, TOLD
from spheretwin.control.supervision.watchdog import REASONS
from spheretwin.models.telemetry.table import Table

Line = tuple[float, str]
"""Simulated time in s, text."""


class FaultLines:
    """Finds these events in a run's telemetry, chunk by chunk."""

    def __init__(self) -> None:
        self._last: dict[str, NDArray[np.float64]] = {}

    def of(self, rows: Table) -> list[Line]:
        """Events of one chunk, in the order of time."""
        names = {signal.name: signal for signal in rows.signals}
        found: list[Line] = []
        if len(rows) and "fault" in names:
            labels, modes = names["fault"].labels, names["fault"].states
            for t_s, part, mode in self._changes(rows, "fault"):
                found.append(
                    (t_s, f"{labels[part]} {modes[mode]}" if mode else f"{labels[part]} works again")
                )
            delays = rows["time_to_detection_s"]
            for t_s, group, out in self._changes(rows, "group_out"):
                after_s = delays[np.searchsorted(rows["t_s"], t_s), group]
                after = f", {1e3 * after_s:.0f} ms after it failed" if out > TOLD and after_s >= 0 else ""
                found.append((t_s, f"group {group} {STATES[out]}{after}"))
        if len(rows) and "failsafe_reason" in names:
            for t_s, _, reason in self._changes(rows, "failsafe_reason"):
                found.append((t_s, f"watchdog: {REASONS[reason].told}"))
        return sorted(found, key=lambda line: line[0])

    def _changes(self, rows: Table, name: str) -> list[tuple[float, int, int]]:
        """Time, place and new value where a column differs from the row before; before the first it is 0."""
        values = rows[name].reshape(len(rows), -1)
        last = self._last.get(name, np.zeros(values.shape[1]))
        self._last[name] = values[-1].copy()
        before = np.concatenate([last[None], values[:-1]])
        ticks, places = np.nonzero(values != before)
        return [
            (float(rows["t_s"][tick]), int(place), int(values[tick, place]))
            for tick, place in zip(ticks, places, strict=True)
        ]
