"""How much the commanded currents go up and down: what chattering costs amplifiers and ears."""

from __future__ import annotations

import numpy as np

from spheretwin.models.telemetry.table import Table
from spheretwin.twin.metrics.metric import Metric, Planned
from spheretwin.twin.metrics.reducing import add_variation


class CurrentVariation(Metric):
    """Total variation of ``current_command_A`` a group a second, A/s.

    Σ|Δi| from tick to tick, as the mean over the groups, over the time from the first tick to the last. Of
    the commands, not of the currents: a command is held from tick to tick, so that nothing of its variation
    lies between the rows, and what the controller asks for is not smoothed by the lag of the coils.
    """

    def __init__(self, planned: Planned) -> None:
        super().__init__(planned)
        groups = len(planned.actuator.groups)
        self._rows, self._variation = 0, np.zeros(groups)
        self._last = np.zeros(groups)

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, at least one."""
        command = np.ascontiguousarray(rows["current_command_A"])
        if not self._rows:
            self._last = command[0].copy()
        add_variation(command, self._last, self._variation)
        self._rows += len(rows)

    def value(self) -> float | None:
        """In A/s; None with fewer than two rows."""
        if self._rows < 2:
            return None
        return float(self._variation.mean() / ((self._rows - 1) * self.planned.period_s))
