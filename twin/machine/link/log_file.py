"""Log of a run on a machine, written while it runs."""

from __future__ import annotations

from collections.abc import Container
from pathlib import Path

import numpy as np

from spheretwin.machine.log import COMMANDED
from spheretwin.models.base.files import check_writable
from spheretwin.models.telemetry import checksums
from spheretwin.models.telemetry.table import PARQUET_FORMAT, Table


class LogFile:
    """Sink that writes the columns of a `machine.Log` as Parquet: time, sent currents, measured angles.

    Parameters
    ----------
    path : Path
    late_ticks : container of int
        Ticks without a new measurement: their angles are NaN.
    period_s : float
        Control period.

    Raises
    ------
    InputError
        The file cannot be written.
    """

    def __init__(self, path: Path, late_ticks: Container[int], period_s: float) -> None:
        check_writable(path, ".parquet")
        self._path, self._late_ticks, self._period_s = path, late_ticks, period_s
        self._parts: list[tuple[np.ndarray, ...]] = []

    def write(self, rows: Table) -> None:
        """Add the rows of one chunk."""
        angle_rad = rows["q_rad"].copy()
        ticks = np.rint(rows["t_s"] / self._period_s).astype(int).tolist()
        angle_rad[[tick in self._late_ticks for tick in ticks]] = np.nan
        self._parts.append((rows["t_s"].copy(), rows["current_A"].copy(), angle_rad))

    def note(self, t_s: float, text: str) -> None:
        """Ignore a message: a log has numbers alone."""

    def finish(self, status: str) -> None:
        """Ignore the final status: `close` writes the file."""

    def close(self) -> None:
        """Write the file, also after an error; no file without a tick."""
        if self._parts:
            write_log(self._path, *map(np.concatenate, zip(*self._parts, strict=True)))


def write_log(path: Path, t_s: np.ndarray, current_A: np.ndarray, angle_rad: np.ndarray) -> None:
    """Write a log of commanded currents."""
    import pyarrow as pa

    columns = {"t_s": pa.array(t_s)}
    for name, values in (("current_A", current_A), ("angle_rad", angle_rad)):
        flat = pa.array(np.ascontiguousarray(values).ravel())
        columns[name] = pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
    table = pa.table(columns).replace_schema_metadata({"currents": COMMANDED})
    checksums.write_parquet(path, table.schema, [table], **PARQUET_FORMAT)
