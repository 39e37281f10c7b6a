"""What a killed process leaves of its files: found beside them, and made whole again."""

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
from spheretwin.models.telemetry.parquet import join
from spheretwin.models.telemetry.partial_files import list_of, read_schema
from spheretwin.models.telemetry.table import Table, read_parquet


def hold_rows(table: Table, period_s: float) -> Table:
    """Rows at every tick from the first to the last, each that of the latest that there is.

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
    """How much was left."""

    rows: int
    seconds: float
    checked: bool
    """True if what was left has checksums; they were compared."""


def find_run_file(path: Path) -> Path:
    """The file of a name; where there is none, what a killed process left of it under a hidden one.

    Raises
    ------
    InputError
        There is nothing, or of several processes.
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
    received = f"what {len(left)} processes left: {', '.join(map(str, left))}" if left else "none"
    raise InputError(f"review {path}: expected the file of a run, received {received}")


def is_recording(path: Path) -> bool:
    """Whether a file that a killed process left is a recording's."""
    return path.suffix == ".part" and ".rrd." in path.name


@contextmanager
def joined_telemetry(folder: Path) -> Iterator[Path]:
    """Give a telemetry file of the parts in a folder.

    Raises
    ------
    InputError
        There are none, or not a row of them is whole.
    """
    with tempfile.TemporaryDirectory(prefix="spheretwin-") as temporary:
        join(_part_files(folder), path := Path(temporary) / "joined.parquet")
        yield path


def recover(path: Path, out: Path) -> Recovered:
    """Write what a killed process left as the file that it was to become.

    Parameters
    ----------
    path : Path
        The file that it did not close, its name, or the folder of its parts.
    out : Path
        Where to write it.

    Raises
    ------
    InputError
        Nothing was left, or the file is whole.
    SpheretwinError
        Writing failed; what was there before is untouched.
    """
    left = find_run_file(path)
    if left.is_dir():
        parts = _part_files(left)
        period_s = _period_s(parts[0])
        rows = join(parts, out)
        return Recovered(rows, rows * period_s, are_checked(left))
    if left.suffix in RECORDINGS or is_recording(left):
        from spheretwin.viz import rerun_internals
        from spheretwin.viz.recording import reader  # Rerun is slow to import

        if rerun_internals.extent(left).ended:
            raise InputError(
                f"recover {left}: expected a recording that was not closed, received a whole one"
            )
        recorded = reader.rewrite(left, out)
        period_s = recorded.facts["sections"]["controller"]["period_s"]
        seconds = len(hold_rows(recorded.table, period_s)) * period_s
        return Recovered(len(recorded.table), seconds, recorded.checked)
    read_parquet(left, rows=False)  # what is no telemetry is told as such
    raise InputError(f"recover {left}: expected what a killed process left, received a whole telemetry file")


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
