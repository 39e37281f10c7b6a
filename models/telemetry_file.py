"""Telemetry streamed to a Parquet file while a run goes on, in memory that does not grow with it.

What has been flushed lies in a hidden folder beside the file, in parts that are whole Parquet files: a killed
process leaves them, any Parquet reader opens them, and `join` makes one file of them.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from spheretwin.models.errors import InputError, SpheretwinError
from spheretwin.models.files import check_writable, whole_file
from spheretwin.models.telemetry import PARQUET_FORMAT, Signal, Table, read_parquet, width

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet

# Rows of a part: four seconds at 1 kHz, some 3 MB in memory.
PART_ROWS = 4096

# Parts of a row group of the file. Arrow keeps 50 kB of each group until the file is whole.
GROUP_PARTS = 4


class TelemetryFile:
    """Follows a run into a Parquet file, which appears when it is closed.

    Parameters
    ----------
    path : Path
        The file.
    signals : tuple of Signal
        Columns, for a run that ends before its first row.
    facts : mapping
        What is known of the run before it starts; kept with every part.

    Raises
    ------
    InputError
        No file can be made there.
    """

    def __init__(self, path: Path, signals: tuple[Signal, ...], facts: Mapping[str, str]) -> None:
        check_writable(path)
        self._path, self._facts = path, dict(facts)
        self._rows = Table(signals, np.empty((0, width(signals))))
        self._waiting: list[Table] = []
        self._parts: list[Path] = []
        self._fault: SpheretwinError | None = None

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, which must not change any more.

        What goes wrong is raised by `close`, so that the run itself goes on.
        """
        if self._fault:
            return
        if rows.signals != self._rows.signals:
            self._flush()
            self._rows = rows.rows(0, 0)
        self._waiting.append(rows)
        # Parts of one length, whatever the chunks: the same rows give the same bytes.
        while not self._fault and sum(map(len, self._waiting)) >= PART_ROWS:
            self._flush(PART_ROWS)

    def note(self, t_s: float, text: str) -> None:
        """Nothing: the command journal is among the facts that `close` is given."""

    def finish(self, status: str) -> None:
        """Take note of how the run ended."""
        self._facts["status"] = status

    def close(self, facts: Mapping[str, str]) -> None:
        """Make the file.

        Parameters
        ----------
        facts : mapping
            What is known of the run now that it has ended, as its command journal.

        Raises
        ------
        SpheretwinError
            It could not be written: what was there before is untouched, and the parts are kept.
        """
        known = {**self._facts, **facts}
        if self._fault:
            raise self._fault
        if not self._parts:
            self._pending().write_parquet(self._path, known)
            return
        self._flush()
        if self._fault:
            raise self._fault
        try:
            join(self._parts, self._path, known)
        except SpheretwinError as error:
            raise SpheretwinError(f"{error}{self._kept()}") from None
        shutil.rmtree(self._parts[0].parent, ignore_errors=True)

    def _pending(self) -> Table:
        values = [self._rows.values, *(rows.values for rows in self._waiting)]
        return Table(self._rows.signals, np.concatenate(values))

    def _flush(self, most: int | None = None) -> None:
        """Write the rows that wait into a part, or the first of them; the others wait on."""
        rows = self._pending()
        last = len(rows) if most is None else most
        self._waiting = [rows.rows(last, len(rows))] if last < len(rows) else []
        if not last:
            return
        try:
            self._parts.append(self._written(rows.rows(0, last)))
        except (OSError, SpheretwinError) as error:
            self._fault = SpheretwinError(f"output: {self._path} could not be written, {error}{self._kept()}")
            self._waiting = []

    def _written(self, rows: Table) -> Path:
        folder = self._parts[0].parent if self._parts else self._new_folder()
        part = folder / f"{len(self._parts):06d}.parquet"
        try:
            rows.write_parquet(part, self._facts)
        except SpheretwinError:
            if not self._parts:
                shutil.rmtree(folder, ignore_errors=True)
            raise
        return part

    def _kept(self) -> str:
        return f"; {len(self._parts)} parts are kept in {self._parts[0].parent}" if self._parts else ""

    def _new_folder(self) -> Path:
        target = self._path.resolve()
        return Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name}.", suffix=".parts"))


def join(parts: Sequence[Path], path: Path, facts: Mapping[str, str] | None = None) -> int:
    """Make one file of the parts that a run has flushed.

    Parameters
    ----------
    parts : sequence of Path
        In their order. Where one lacks a column that another has (the law was changed), it is NaN there.
    path : Path
        The file.
    facts : mapping, optional
        Metadata of the file; those of the first part unless given.

    Returns
    -------
    int
        Rows of the file.

    Raises
    ------
    InputError
        There is no part, one is no telemetry, or two have different columns of one name.
    SpheretwinError
        Writing failed; what was there before is untouched.
    """
    import pyarrow.parquet  # slow to import, and most runs write no file

    if not parts:
        raise InputError("telemetry: expected at least one part, received none")
    signals = _all_signals(parts)
    known = read_parquet(parts[0], rows=False)[1] if facts is None else facts
    schema = Table(signals, np.empty((0, width(signals)))).arrow(known).schema
    with (
        whole_file(path) as temporary,
        pyarrow.parquet.ParquetWriter(temporary, schema, **PARQUET_FORMAT) as writer,
    ):
        return sum(_append(writer, group, signals) for group in _grouped(parts))


def _append(writer: pyarrow.parquet.ParquetWriter, parts: Sequence[Path], signals: tuple[Signal, ...]) -> int:
    """Write some parts as one row group; returns its rows."""
    import pyarrow as pa

    group = pa.concat_tables([_columns(part, signals) for part in parts])
    group = group.replace_schema_metadata(writer.schema.metadata)
    writer.write_table(group, row_group_size=max(1, group.num_rows))
    pa.default_memory_pool().release_unused()  # else Arrow keeps what a hundred groups have needed
    return int(group.num_rows)


def _columns(part: Path, signals: tuple[Signal, ...]) -> pa.Table:
    """A part as Arrow has it, with all columns of the file."""
    import pyarrow.parquet

    with pyarrow.parquet.ParquetFile(part) as file:
        found = tuple(file.schema_arrow.names)
        if found == tuple(signal.name for signal in signals):
            return file.read(use_threads=False)
    return _widened(read_parquet(part)[0], signals).arrow({})


def _grouped(parts: Sequence[Path]) -> Iterator[Sequence[Path]]:
    return (parts[first : first + GROUP_PARTS] for first in range(0, len(parts), GROUP_PARTS))


def _all_signals(parts: Iterable[Path]) -> tuple[Signal, ...]:
    """Columns of all parts, each once, in the order in which they first appear."""
    found: dict[str, Signal] = {}
    for part in parts:
        for signal in read_parquet(part, rows=False)[0].signals:
            known = found.setdefault(signal.name, signal)
            if known != signal:
                raise InputError(
                    f"telemetry {part}: expected {signal.name} as {known.size} numbers in {known.unit}"
                    f" ({known.meaning}), received {signal.size} in {signal.unit} ({signal.meaning})"
                )
    return tuple(found.values())


def _widened(table: Table, signals: tuple[Signal, ...]) -> Table:
    wide = Table(signals, np.full((len(table), width(signals)), np.nan))
    for signal in table.signals:
        wide[signal.name][:] = table[signal.name]
    return wide
