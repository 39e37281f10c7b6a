"""Recovery of the partial files of a killed process: search and completion."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.errors import InputError, without_breaks
from spheretwin.models.base.extras import check_recordings
from spheretwin.models.telemetry.parquet import join
from spheretwin.models.telemetry.partial_files import list_of, read_schema
from spheretwin.models.telemetry.table import Table, read_parquet


def hold_rows(table: Table, period_s: float) -> Table:
    """Return a row at every tick from the first to the last: that of the latest row (zero-order hold).

    Parameters
    ----------
    table : Table
        Some rows of a run, in the order of time.
    period_s : float
        Time between ticks, s.
    """
    if not len(table):
        return table
    ticks = ticks_of(table, period_s)
    every = np.arange(ticks[0], ticks[-1] + 1)
    rows = Table(table.signals, table.values[np.searchsorted(ticks, every, side="right") - 1])
    rows["t_s"][:] = every * period_s
    return rows


def ticks_of(table: Table, period_s: float) -> NDArray[np.int64]:
    """Tick of each row."""
    return np.rint(table["t_s"] / period_s).astype(np.int64)


RECORDINGS = (".rrd",)


class Recovered(NamedTuple):
    """Amount of recovered data."""

    rows: int
    seconds: float
    checked: bool
    """True if the partial files have checksums; they were compared."""


def find_run_file(path: Path) -> Path:
    """Return the file of a name; if it does not exist, the hidden partial file of a killed process.

    Raises
    ------
    InputError
        There is none, or there are partial files of several processes.
    """
    try:
        if path.exists():
            return path
        left = sorted(
            file for kind in ("parts", "part") for file in path.parent.glob(f".{path.name}.*.{kind}")
        )
    except (OSError, ValueError) as error:  # ValueError: a zero in the path
        raise InputError(f"review {path}: expected the file of a run, {without_breaks(error)}") from None
    if len(left) == 1:
        return left[0]
    received = f"partial files of {len(left)} processes: {', '.join(map(str, left))}" if left else "none"
    raise InputError(f"review {path}: expected the file of a run, received {received}")


def is_recording(path: Path) -> bool:
    """True if a partial file is one of a recording."""
    return path.suffix == ".part" and ".rrd." in path.name


@contextmanager
def joined_telemetry(folder: Path) -> Iterator[Path]:
    """Give a telemetry file of the parts in a folder.

    Raises
    ------
    InputError
        There are no parts, or none has a complete row.
    """
    with tempfile.TemporaryDirectory(prefix="spheretwin-") as temporary:
        join(_part_files(folder), path := Path(temporary) / "joined.parquet")
        yield path


def recover(path: Path, out: Path) -> Recovered:
    """Complete the partial files of a killed process.

    Parameters
    ----------
    path : Path
        The file that it did not close, its name, or the folder of its parts.
    out : Path
        File to write.

    Raises
    ------
    InputError
        There are no partial files, or the file is complete.
    SpheretwinError
        Writing failed; the previous file is unchanged.
    """
    left = find_run_file(path)
    if left.is_dir():
        parts = _part_files(left)
        period_s = _period_s(parts[0])
        rows = join(parts, out)
        return Recovered(rows, rows * period_s, are_checked(left))
    if left.suffix in RECORDINGS or is_recording(left):
        check_recordings(f"recover {left}")
        from spheretwin.viz import rerun_internals
        from spheretwin.viz.recording import reader  # Rerun is slow to import

        if rerun_internals.extent(left).ended:
            raise InputError(
                f"recover {left}: expected a recording that was not closed, received a complete one"
            )
        recorded = reader.rewrite(left, out)
        period_s = recorded.facts["sections"]["controller"]["period_s"]
        seconds = len(hold_rows(recorded.table, period_s)) * period_s
        return Recovered(len(recorded.table), seconds, recorded.checked)
    read_parquet(left, rows=False)  # other files are refused here
    raise InputError(
        f"recover {left}: expected partial files of a killed process, received a complete telemetry file"
    )


def _period_s(part: Path) -> float:
    """Control period of the run that a part is of, s."""
    schema = read_schema(part)
    try:
        return float(json.loads((schema.metadata if schema else {})[b"scenario"])["controller"]["period_s"])
    except (KeyError, ValueError, TypeError, RecursionError):
        raise InputError(
            f"telemetry {part}: expected a part with the scenario of a run, received none that can be read"
        ) from None


def are_checked(folder: Path) -> bool:
    """Return whether all parts in a folder have checksums."""
    return all(list_of(part).is_file() for part in _part_files(folder))


def _part_files(folder: Path) -> list[Path]:
    if parts := sorted(folder.glob("*.arrows")):
        return parts
    raise InputError(f"telemetry {folder}: expected a folder of parts, received one without any")
