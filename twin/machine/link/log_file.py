"""Log of a run on a machine, written while it runs."""

from __future__ import annotations

import json
from collections.abc import Container, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from spheretwin.machine.files import CONDITIONS, CURRENTS, log_signals
from spheretwin.machine.log import COMMANDED
from spheretwin.models.base.files import check_writable
from spheretwin.models.telemetry.table import Table


class LogFile:
    """Sink that writes a log as Parquet: time, measured angles, commanded currents.

    Parameters
    ----------
    path : Path
    late_ticks : container of int
        Ticks without a new measurement: their angles are NaN.
    period_s : float
        Control period.
    conditions : mapping
        Known fields of the scenario during the run.

    Raises
    ------
    InputError
        The file cannot be written.
    """

    def __init__(
        self, path: Path, late_ticks: Container[int], period_s: float, conditions: Mapping[str, Any]
    ) -> None:
        check_writable(path, ".parquet")
        self._path, self._late_ticks, self._period_s = path, late_ticks, period_s
        self._metadata = {CURRENTS: COMMANDED, CONDITIONS: json.dumps(dict(conditions))}
        self._parts: list[np.ndarray] = []

    def write(self, rows: Table) -> None:
        """Add the rows of one chunk."""
        angle_rad = rows["q_rad"].copy()
        ticks = np.rint(rows["t_s"] / self._period_s).astype(int).tolist()
        angle_rad[[tick in self._late_ticks for tick in ticks]] = np.nan
        self._parts.append(np.column_stack([rows["t_s"], angle_rad, rows["current_A"]]))

    def note(self, t_s: float, text: str) -> None:
        """Ignore a message: a log has numbers alone."""

    def finish(self, status: str) -> None:
        """Ignore the final status: `close` writes the file."""

    def close(self) -> None:
        """Write the file, also after an error; no file without a tick."""
        if self._parts:
            rows = np.concatenate(self._parts)
            signals = log_signals(rows.shape[1] - 4, (COMMANDED,))
            Table(signals, rows).scalars().write_parquet(self._path, self._metadata)
