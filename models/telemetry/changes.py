"""Changes of columns of states from tick to tick, chunk by chunk."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.table import Table


class StateChange(NamedTuple):
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

    def of(self, rows: Table, name: str) -> list[StateChange]:
        """Return the changes of a column in one chunk, at least one row, in the order of time."""
        values = rows[name].reshape(len(rows), -1)
        last = self._last.get(name, np.zeros(values.shape[1]))
        self._last[name] = values[-1].copy()
        before = np.concatenate([last[None], values[:-1]])
        return [
            StateChange(int(tick), float(rows["t_s"][tick]), int(entry), int(values[tick, entry]))
            for tick, entry in zip(*np.nonzero(values != before), strict=True)
        ]
