"""Telemetry streamed to a Parquet file during a run, with constant memory.

Flushed rows are in Arrow streams (parts) in a hidden folder next to the file. A killed process leaves them.
Any Arrow reader opens them, and `join` makes one file of them.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from spheretwin.models.base.errors import InputError, SpheretwinError, without_breaks
from spheretwin.models.base.files import OPEN_FILES, PartialFile, check_writable
from spheretwin.models.telemetry.checksums import write_parquet
from spheretwin.models.telemetry.partial_files import PartialStreams, read_batches, read_schema
from spheretwin.models.telemetry.signals import Signal, width
from spheretwin.models.telemetry.table import PARQUET_FORMAT, Table

if TYPE_CHECKING:
    import pyarrow as pa

# Rows of a batch of a part: four seconds at 1 kHz, some 3 MB in memory.
PART_ROWS = 4096

# Time for which an ending process waits for a chunk that is being written.
PATIENCE_s = 2.0

# Batches of a row group of the file. The rows of one group are in memory at a time, and Arrow stores 15 kB of
# each until the file is complete: over two hours at 1 kHz, three or four batches need the least memory.
GROUP_BATCHES = 4


class TelemetryFile:
    """Sink of a run that writes a Parquet file, which appears when it is closed.

    Parameters
    ----------
    path : Path
        The file.
    signals : tuple of Signal
        Columns, for a run that ends before its first row.
    facts : mapping
        Metadata known before the run; stored in every part.

    Raises
    ------
    InputError
        No file can be written there.
    """

    def __init__(self, path: Path, signals: tuple[Signal, ...], facts: Mapping[str, str]) -> None:
        check_writable(path, ".parquet")
        self._path, self._facts = path, dict(facts)
        self._rows = Table(signals, np.empty((0, width(signals))))
        self._waiting: list[Table] = []
        self._parts = PartialStreams(path, facts)
        self._fault: SpheretwinError | None = None
        self._lock, self._closed = threading.Lock(), False
        OPEN_FILES.add(self)

    def write(self, rows: Table) -> None:
        """Write the rows of one chunk, which must not change later.

        An error is raised by `close`, so that the run continues.
        """
        with self._lock:
            self._write(rows)

    def _write(self, rows: Table) -> None:
        if self._fault:
            return
        if rows.signals != self._rows.signals:
            self._flush()
            self._rows = rows.rows(0, 0)
        self._waiting.append(rows)
        # Batches of one length for any chunks: the same rows give the same bytes.
        while not self._fault and sum(map(len, self._waiting)) >= PART_ROWS:
            self._flush(PART_ROWS)

    def note(self, t_s: float, text: str) -> None:
        """Ignore a note: `close` receives the command journal."""

    def finish(self, status: str) -> None:
        """Store the final status of the run."""
        self._facts["status"] = status

    def close(self, facts: Mapping[str, str]) -> None:
        """Write the file.

        Parameters
        ----------
        facts : mapping
            Metadata known after the run, such as its command journal.

        Raises
        ------
        SpheretwinError
            Writing failed: an earlier file is unchanged, and the parts remain.
        """
        with self._lock:
            try:
                self._close({**self._facts, **facts})
            finally:
                self._closed = True
                OPEN_FILES.remove(self)

    def partial(self) -> PartialFile | None:
        """Flush the pending rows; return the parts, if there are rows. For a process that is ending."""
        if self._lock.acquire(timeout=PATIENCE_s):  # its holder has flushed, or will flush
            try:
                if not (self._fault or self._closed):
                    self._flush()
            finally:
                self._lock.release()
        if self._closed or not self._parts.rows:
            return None
        return PartialFile(self._parts.folder, self._path, self._parts.rows)

    def _close(self, facts: Mapping[str, str]) -> None:
        if self._fault:
            raise self._fault
        if not self._parts.rows:
            self._pending().write_parquet(self._path, facts)
            return
        self._flush()
        if self._fault:
            raise self._fault
        try:
            self._parts.close()
            join(self._parts.paths, self._path, facts)
        except OSError as error:
            raise self._unwritten(error) from None
        except SpheretwinError as error:
            raise SpheretwinError(f"{error}{self._kept_rows_text()}") from None
        self._parts.remove()

    def _pending(self) -> Table:
        values = [self._rows.values, *(rows.values for rows in self._waiting)]
        return Table(self._rows.signals, np.concatenate(values))

    def _flush(self, most: int | None = None) -> None:
        """Append the pending rows, or the first `most` of them, to the parts."""
        rows = self._pending()
        last = len(rows) if most is None else most
        self._waiting = [rows.rows(last, len(rows))] if last < len(rows) else []
        if not last:
            return
        try:
            self._parts.append(rows.rows(0, last))
        except OSError as error:
            self._fault = self._unwritten(error)
            self._waiting = []

    def _unwritten(self, error: OSError) -> SpheretwinError:
        return SpheretwinError(
            f"output: {self._path} could not be written, {without_breaks(error)}{self._kept_rows_text()}"
        )

    def _kept_rows_text(self) -> str:
        return f"; {self._parts.rows} rows are kept in {self._parts.folder}" if self._parts.rows else ""


def join(parts: Sequence[Path], path: Path, facts: Mapping[str, str] | None = None) -> int:
    """Merge the parts that a run has flushed into one file.

    Parameters
    ----------
    parts : sequence of Path
        In order. A column that a part lacks (the law was changed) is NaN there. The last part may be torn by
        a killed process: its complete batches are used.
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
        There is no part, one is not telemetry, one before the last is torn, none has a complete batch, or two
        have different columns of one name.
    SpheretwinError
        Writing failed; an earlier file is unchanged.
    """
    if not parts:
        raise InputError("telemetry: expected at least one part, received none")
    schema = _joint_schema(parts, facts)
    return write_parquet(path, schema, _groups(parts, schema), **PARQUET_FORMAT)


def _groups(parts: Sequence[Path], schema: pa.Schema) -> Iterator[pa.Table]:
    """Yield the row groups of the file; at least one."""
    import pyarrow as pa  # slow to import, and most runs write no file

    batches = (_with_all_columns(batch, schema) for batch in _batches(parts))
    rows = 0
    while len(group := pa.Table.from_batches(islice(batches, GROUP_BATCHES), schema)):
        rows += len(group)
        yield group
        pa.default_memory_pool().release_unused()  # otherwise Arrow retains the memory of a hundred groups
    if not rows:
        raise _empty(parts)


def _batches(parts: Sequence[Path]) -> Iterator[pa.RecordBatch]:
    """Yield the complete batches of all parts."""
    for place, part in enumerate(parts, 1):
        torn = yield from read_batches(part)
        if torn and place < len(parts):  # rows are missing, and not at the end
            raise InputError(f"telemetry {part}: expected only the last part to be torn, received a torn one")


def _joint_schema(parts: Sequence[Path], facts: Mapping[str, str] | None) -> pa.Schema:
    """Return the columns of all parts, each once, in order of first appearance."""
    import pyarrow as pa

    fields: dict[str, pa.Field] = {}
    metadata = facts
    for part in parts:
        schema = read_schema(part)
        if schema is None:
            continue
        metadata = schema.metadata if metadata is None else metadata
        for field in schema:
            first = fields.setdefault(field.name, field)
            if not first.equals(field, check_metadata=True):
                raise InputError(
                    f"telemetry {part}: expected {field.name} as {_size(first)} numbers {_words(first)},"
                    f" received {_size(field)} {_words(field)}"
                )
    if not fields:
        raise _empty(parts)
    return pa.schema(fields.values(), metadata=metadata)


def _empty(parts: Sequence[Path]) -> InputError:
    return InputError(f"telemetry {parts[0]}: expected a part with a whole batch of rows, received none")


def _words(field: pa.Field) -> str:
    described = {key.decode(): value.decode() for key, value in field.metadata.items()}
    return f"in {described['unit']} ({described['meaning']})"


def _size(field: pa.Field) -> int:
    return getattr(field.type, "list_size", 1)


def _with_all_columns(batch: pa.RecordBatch, schema: pa.Schema) -> pa.RecordBatch:
    """Return a batch with all columns of the file."""
    import pyarrow as pa

    present = set(batch.schema.names)
    columns = [
        batch.column(field.name) if field.name in present else _column_of_nan(field, len(batch))
        for field in schema
    ]
    return pa.RecordBatch.from_arrays(columns, schema=schema)


def _column_of_nan(field: pa.Field, rows: int) -> pa.Array:
    """Return a column of NaN."""
    import pyarrow as pa

    flat = pa.array(np.full(rows * _size(field), np.nan))
    return flat if pa.types.is_float64(field.type) else pa.FixedSizeListArray.from_arrays(flat, _size(field))
