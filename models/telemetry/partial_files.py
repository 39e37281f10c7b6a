"""Partial files of a run: Arrow streams in a hidden folder next to its file, one for each set of columns.

A stream grows by complete batches of rows, so that a killed process leaves all flushed rows. At worst the
last batch of the last stream is torn; readers skip it. A file next to each stream lists the
checksums of its batches. Writing a stream takes little memory; that of a Parquet file grows with each row
group.
"""

from __future__ import annotations

import shutil
import tempfile
import zlib
from collections.abc import Generator, Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spheretwin.models.base.errors import InputError, shown
from spheretwin.models.base.files import regular_file
from spheretwin.models.telemetry.checksums import Segment, SegmentedFile, damaged, text_checksum, unreadable
from spheretwin.models.telemetry.signals import Signal, width
from spheretwin.models.telemetry.table import Table

if TYPE_CHECKING:
    import pyarrow as pa

# First bytes of each message of a stream; the length of its description follows, in as many bytes.
_MESSAGE = b"\xff\xff\xff\xff"

_STREAM = "an Arrow stream of a run"


class PartialStreams:
    """Sink of a run that writes Arrow streams, created with the first rows.

    Parameters
    ----------
    path : Path
        Path of the complete file.
    facts : mapping
        Metadata of each stream.

    Attributes
    ----------
    paths : list of Path
        Streams, in order; each holds at least one complete batch.
    rows : int
        Rows in all of them.
    """

    def __init__(self, path: Path, facts: Mapping[str, str]) -> None:
        self._path, self._facts = path, dict(facts)
        self.paths: list[Path] = []
        self.rows = 0
        self._signals: tuple[Signal, ...] = ()
        # Of the last stream: its file, its list of checksums, its writer.
        self._sink: SegmentedFile | None = None
        self._list: SegmentList | None = None
        self._writer: Any = None

    @property
    def folder(self) -> Path:
        """Folder of the streams; there must be one."""
        return self.paths[0].parent

    def append(self, rows: Table) -> None:
        """Write rows, at least one, as one batch.

        Raises
        ------
        OSError
            Writing failed. Earlier batches remain, and nothing can be added.
        """
        try:
            if rows.signals == self._signals:
                self._write(rows)
            else:
                self.close()
                self._begin(rows)
        except OSError:
            self._abandon()
            raise
        self.rows += len(rows)

    def close(self) -> None:
        """End the last stream.

        Raises
        ------
        OSError
            The end could not be written; all rows were.
        """
        if self._writer is not None and self._sink is not None:
            self._writer.close()
            self._end_batch()
            self._close_files()

    def remove(self) -> None:
        """Delete all streams; they must be closed."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _begin(self, rows: Table) -> None:
        """Open a stream for rows with new columns; it exists with its first batch or not at all."""
        import pyarrow as pa  # slow to import, and most runs write no file

        folder = self.folder if self.paths else self._new_folder()
        part = folder / f"{len(self.paths):06d}.arrows"
        try:
            self._sink, self._list = SegmentedFile(part), SegmentList(part)
            self._writer = pa.ipc.new_stream(self._sink, _schema(rows.signals, self._facts))
            self._write(rows)
        except OSError:
            part.unlink(missing_ok=True)
            list_of(part).unlink(missing_ok=True)
            if not self.paths:
                shutil.rmtree(folder, ignore_errors=True)
            raise
        self._signals = rows.signals
        self.paths.append(part)

    def _write(self, rows: Table) -> None:
        self._writer.write_table(rows.arrow({}))
        self._end_batch()

    def _end_batch(self) -> None:
        """Flush a batch, then write its checksum."""
        if self._sink is not None and self._list is not None:
            self._sink.flush()
            self._list.append(self._sink.end_segment())

    def _close_files(self) -> None:
        for file in (self._sink, self._list):
            if file is not None:
                file.close()

    def _abandon(self) -> None:
        """Close a stream that cannot be written, without an end: it is read up to its last complete batch."""
        with suppress(OSError):
            self._close_files()
        self._sink = self._list = self._writer = None

    def _new_folder(self) -> Path:
        target = self._path.resolve()
        return Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name}.", suffix=".parts"))


def _schema(signals: tuple[Signal, ...], facts: Mapping[str, str]) -> pa.Schema:
    return Table(signals, np.empty((0, width(signals)))).arrow(facts).schema


def read_schema(part: Path) -> pa.Schema | None:
    """Return columns and metadata of a part; None if it is torn before them.

    Raises
    ------
    InputError
        It cannot be read, or is not telemetry of this package.
    """
    import pyarrow as pa

    segments = read_list(part)
    with _opened(part) as source:
        if segments is not None and not (segments and _is_whole(part, source, 0, segments[0], 0)):
            return None
        source.seek(0)
        try:
            schema = pa.ipc.open_stream(source).schema
        except (pa.ArrowException, OSError) as error:
            if _is_torn_at_its_start(part):
                return None
            raise unreadable(part, error, _STREAM) from None
    if not _is_telemetry(schema):
        raise InputError(
            f"telemetry {part}: expected {_STREAM},"
            f" received {shown(', '.join(schema.names)) if schema.names else 'one without columns'}"
        )
    return schema


def read_batches(part: Path) -> Generator[pa.RecordBatch, None, bool]:
    """Yield the complete batches of a part, without copies; return True if it is torn after them.

    Raises
    ------
    InputError
        It cannot be read, or a batch differs from what was written.
    """
    import pyarrow as pa

    segments = read_list(part)
    schema, checked, place = None, 0, 0
    for number in count():
        # One mapping per batch: the read part of a mapped file counts as memory of the process while it is
        # mapped.
        with _opened(part) as source:
            if segments is not None:
                if number == len(segments):
                    return checked < source.size()
                if not _is_whole(part, source, checked, segments[number], number):
                    return True
                checked += segments[number].size
            try:
                source.seek(place)
                schema = schema or pa.ipc.open_stream(source).schema
                batch = pa.ipc.read_record_batch(pa.ipc.read_message(source), schema)
                place = source.tell()
            except EOFError:
                return False
            except (pa.ArrowException, OSError):
                return True
        yield batch
        del batch
    return False


def _is_whole(part: Path, source: pa.MemoryMappedFile, start: int, segment: Segment, number: int) -> bool:
    """Return True if a segment is complete; raise `InputError` if it differs from what was written."""
    source.seek(start)
    block = source.read_buffer(segment.size)
    if len(block) < segment.size:
        return False
    if zlib.crc32(block) != segment.crc32:
        raise damaged(part, f"batch {number}")
    return True


@contextmanager
def _opened(part: Path) -> Iterator[pa.MemoryMappedFile]:
    import pyarrow as pa

    try:
        source = pa.memory_map(str(regular_file(part)))
    except OSError as error:
        raise unreadable(part, error, _STREAM) from None
    with source:
        yield source


def _is_torn_at_its_start(part: Path) -> bool:
    with part.open("rb") as file:
        head = file.read(2 * len(_MESSAGE))
    described = int.from_bytes(head[len(_MESSAGE) :], "little")
    return _MESSAGE.startswith(head[: len(_MESSAGE)]) and part.stat().st_size < 2 * len(_MESSAGE) + described


def _is_telemetry(schema: pa.Schema) -> bool:
    return 0 < len(schema) == len(set(schema.names)) and all(map(_is_signal, schema))


def _is_signal(field: pa.Field) -> bool:
    import pyarrow as pa

    of_vector = pa.types.is_fixed_size_list(field.type)
    return {b"unit", b"meaning", b"labels"} <= set(field.metadata or {}) and pa.types.is_float64(
        field.type.value_type if of_vector else field.type
    )


# --- checksums

# Line of a list: length and checksum of a segment, checksum of the line.
_LINE_BYTES = len("000000000000 00000000 00000000\n")


class SegmentList:
    """List of the segments of a growing file, in a file next to it: one line each, written after the segment.

    Parameters
    ----------
    path : Path
        The growing file.
    """

    def __init__(self, path: Path) -> None:
        import pyarrow as pa

        self._file = pa.OSFile(str(list_of(path)), "wb")

    def append(self, segment: Segment) -> None:
        """Add a segment."""
        self._file.write(_line(segment))

    def close(self) -> None:
        """Close the list."""
        self._file.close()


def list_of(path: Path) -> Path:
    """Return the path of the list of a file's segments."""
    return path.with_name(f"{path.name}.checksums")


def read_list(path: Path) -> list[Segment] | None:
    """Return the segments of a file that has a list; None without one.

    Raises
    ------
    InputError
        A line of the list differs from what was written.
    """
    listed = list_of(path)
    if not listed.is_file():
        return None
    try:
        lines = listed.read_bytes()
    except OSError as error:
        raise unreadable(listed, error, "the checksums of a run") from None
    whole = range(0, len(lines) - _LINE_BYTES + 1, _LINE_BYTES)  # the last line may be torn
    segments = [_segment(lines[first : first + _LINE_BYTES]) for first in whole]
    if None in segments:
        raise damaged(listed, f"line {segments.index(None)}")
    return [segment for segment in segments if segment is not None]


def _line(segment: Segment) -> bytes:
    text = f"{segment.size:012d} {segment.crc32:08x}"
    return f"{text} {text_checksum(text)}\n".encode()


def _segment(line: bytes) -> Segment | None:
    """Return the segment of a line; None if the line differs from what was written."""
    try:
        size, crc32, _ = line.split()
        segment = Segment(int(size), int(crc32, 16))
    except ValueError:
        return None
    return segment if _line(segment) == line else None
