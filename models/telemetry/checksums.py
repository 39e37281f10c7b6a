"""Checksums (CRC-32) of telemetry: of the bytes of Parquet files and Arrow streams, of rows and texts.

The bytes of a file are checked in segments, each with its length and its checksum. In a Parquet file a
segment is a row group. The footer lists the segments and has a checksum of its own, so that every bit of the
file is checked. Readers compare before they decode anything.
"""

from __future__ import annotations

import json
import re
import shlex
import zlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import LONGEST_WORD, InputError, shortened, without_breaks
from spheretwin.models.base.files import regular_file, whole_file

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet

NO_CHECKSUMS = "has no checksums, it was written by an earlier version: damage may be unnoticed"
"""Warning for a file that is read without a check."""


# Metadata of a Parquet file. Two names: damage to one of them does not look like a file without checksums.
_SEGMENTS, _FOOTER = "row_group_checksums", "footer_checksum"
METADATA = (_SEGMENTS, _FOOTER)

# The value of a name in the footer is a text in Thrift's compact form: this byte, its length, its bytes.
_TEXT = b"\x18"
_FOOTER_VALUE = re.compile(_FOOTER.encode() + _TEXT + rb"\x08([0-9a-f]{8})")
_UNSIGNED = "0" * 8
_FOOTER_END = 8  # bytes: length of the footer, magic
_MAGIC = b"PAR1"

# Largest number of rows of a row group, the default of pyarrow.
_GROUP_ROWS = 1 << 20
_BLOCK_BYTES = 1 << 20

_HALF = np.uint64(32)


class Segment(NamedTuple):
    """Section of a file, directly after the previous one."""

    size: int
    crc32: int


class SegmentedFile:
    """New file that computes the checksum of its bytes; pyarrow writes to it as to any file object."""

    def __init__(self, path: Path) -> None:
        import pyarrow as pa  # slow to import, and most runs write no file

        self._file = pa.OSFile(str(path), "wb")  # without a buffer of its own
        self._segment = Segment(0, 0)

    @property
    def closed(self) -> bool:
        """True if the file is closed."""
        return bool(self._file.closed)

    def write(self, block: bytes) -> int:
        """Append some bytes to the segment."""
        self._segment = Segment(self._segment.size + len(block), zlib.crc32(block, self._segment.crc32))
        self._file.write(block)
        return len(block)

    def tell(self) -> int:
        """Return the number of bytes written."""
        return int(self._file.tell())

    def flush(self) -> None:
        """Pass the written bytes to the operating system."""
        self._file.flush()

    def end_segment(self) -> Segment:
        """Return the segment up to here and begin the next one."""
        segment, self._segment = self._segment, Segment(0, 0)
        return segment

    def close(self) -> None:
        """Close the file."""
        self._file.close()


# --- Parquet


def write_parquet(path: Path, schema: pa.Schema, tables: Iterable[pa.Table], **options: Any) -> int:
    """Write a Parquet file with checksums of its pages, row groups and footer, completely or not at all.

    Parameters
    ----------
    path : Path
        The file.
    schema : pa.Schema
        Columns and metadata.
    tables : iterable of pa.Table
        One row group each, or several if a table has more rows than a group holds.
    **options
        Of `pyarrow.parquet.ParquetWriter`.

    Returns
    -------
    int
        Rows of the file.

    Raises
    ------
    InputError
        No file can be made there.
    SpheretwinError
        Writing failed; an earlier file is unchanged.
    """
    import pyarrow.parquet  # slow to import, and most runs write no file

    rows, segments = 0, []
    with whole_file(path, ".parquet") as temporary:
        sink = SegmentedFile(temporary)
        try:
            with pyarrow.parquet.ParquetWriter(sink, schema, write_page_checksum=True, **options) as writer:
                for table in tables:
                    for first in range(0, max(len(table), 1), _GROUP_ROWS):
                        writer.write_table(table.slice(first, _GROUP_ROWS), row_group_size=_GROUP_ROWS)
                        segments.append(sink.end_segment())
                    rows += len(table)
                listed = " ".join(f"{size} {crc32:08x}" for size, crc32 in segments)
                writer.add_key_value_metadata({_SEGMENTS: listed, _FOOTER: _UNSIGNED})
        finally:
            sink.close()
        _sign(temporary)
    return rows


def open_parquet(path: Path, *, rows: bool = True) -> pyarrow.parquet.ParquetFile:
    """Open a Parquet file and compare its checksums, if it has any.

    Parameters
    ----------
    path : Path
        The file.
    rows : bool
        If False, only the footer is compared.

    Raises
    ------
    InputError
        A checksum differs: the message names the footer, or the row group and where possible the column.
    OSError, pa.ArrowException
        The file is missing, or is not a Parquet file.
    """
    import pyarrow.parquet

    checked = has_checksums(path)
    file = pyarrow.parquet.ParquetFile(path, page_checksum_verification=True)
    if checked and rows:
        listed = file.metadata.metadata[_SEGMENTS.encode()].decode().split()
        segments = [
            Segment(int(size), int(crc32, 16)) for size, crc32 in zip(listed[::2], listed[1::2], strict=True)
        ]
        if (place := _first_changed(path, segments)) is not None:
            raise damaged(path, _group(file, place))
    return file


def has_checksums(path: Path) -> bool:
    """Return True if a Parquet file has checksums; compare the checksum of its footer.

    Raises
    ------
    InputError
        The footer differs from the one that was written.
    OSError
        The file cannot be read.
    """
    with regular_file(path).open("rb") as file:
        _, footer = _footer(file)
    match = _FOOTER_VALUE.search(footer)
    listed = _SEGMENTS.encode() + _TEXT in footer
    if match is None and not listed:
        return False
    if match is None or not listed or _footer_checksum(footer, match) != match[1].decode():
        raise damaged(path, "the footer")
    return True


def damaged(path: Path, place: str) -> InputError:
    """Return the error for a file that differs from what was written."""
    return InputError(
        f"file {path}: expected the bytes that were written, received others in {place}:"
        " the file is damaged, or was changed by another program"
    )


def unreadable(path: Path, error: BaseException, expected: str) -> InputError:
    """Return the error for a file that another library could not read.

    A recording in place of telemetry is named as such: it can be converted.
    """
    if _is_recording(path):
        return InputError(
            f"file {path}: expected {expected}, received a recording;"
            f" `spheretwin review {shlex.quote(str(path))} --export FILE.parquet` writes its telemetry,"
            " and `simulate` with --telemetry that of a new run"
        )
    reason = shortened(without_breaks(error), LONGEST_WORD)
    return InputError(f"file {path}: expected {expected}, {reason}")


def _is_recording(path: Path) -> bool:
    """Return True if a file has the name of a recording, and begins as one in any version of its format."""
    if path.suffix != ".rrd":
        return False
    try:
        with regular_file(path).open("rb") as file:
            return file.read(3) == b"RRF"
    except OSError:
        return False


def _sign(path: Path) -> None:
    """Write the checksum of the footer into the footer."""
    with path.open("r+b") as file:
        start, footer = _footer(file)
        match = _FOOTER_VALUE.search(footer)
        assert match is not None  # it was just written
        file.seek(start + match.start(1))
        file.write(_footer_checksum(footer, match).encode())


def _footer_checksum(footer: bytes, match: re.Match[bytes]) -> str:
    unsigned = footer[: match.start(1)] + _UNSIGNED.encode() + footer[match.end(1) :]
    return f"{zlib.crc32(unsigned):08x}"


def _footer(file: BinaryIO) -> tuple[int, bytes]:
    """Return position and bytes of the footer with its length and magic; no bytes if there is none."""
    size = file.seek(0, 2)
    file.seek(max(size - _FOOTER_END, 0))
    end = file.read()
    start = size - _FOOTER_END - int.from_bytes(end[:4], "little")
    if not end.endswith(_MAGIC) or start < 0:
        return 0, b""
    file.seek(start)
    return start, file.read()


def _first_changed(path: Path, segments: Iterable[Segment]) -> int | None:
    """Return the index of the first changed segment; None if there is none."""
    with path.open("rb") as file:
        for place, segment in enumerate(segments):
            if _read_segment(file, segment.size) != segment:
                return place
    return None


def _read_segment(file: BinaryIO, size: int) -> Segment:
    """Read the next bytes of a file, fewer at its end."""
    done, crc32 = 0, 0
    while block := file.read(min(size - done, _BLOCK_BYTES)):
        done, crc32 = done + len(block), zlib.crc32(block, crc32)
    return Segment(done, crc32)


def _group(file: pyarrow.parquet.ParquetFile, place: int) -> str:
    """Return number and rows of a row group, and the first column with a changed page."""
    import pyarrow as pa

    if not file.metadata.num_rows:
        return f"row group {place}"
    counts = [file.metadata.row_group(group).num_rows for group in range(place + 1)]
    text = f"row group {place}, rows {sum(counts[:-1])} to {sum(counts) - 1}"
    for name in file.schema_arrow.names:
        try:
            file.read_row_group(place, columns=[name], use_threads=False)
        except (OSError, pa.ArrowException):
            return f"{text}, column {name}"
    return text


# --- rows and texts


def text_checksum(text: str) -> str:
    """Return the checksum of a text, in hexadecimal digits."""
    return f"{zlib.crc32(text.encode()):08x}"


def line_checksums(lines: Sequence[tuple[int, str, str]], first: int) -> NDArray[np.uint64]:
    """Return number and checksum of each line of a log: the number in the upper 32 bits.

    Parameters
    ----------
    lines : sequence of tuple
        Time in ns, level and text.
    first : int
        Number of the first line.
    """
    sums = np.array([zlib.crc32(json.dumps(line).encode()) for line in lines], dtype=np.uint64)
    return (np.arange(first, first + len(sums), dtype=np.uint64) << _HALF) | sums


def line_numbers(checksums: NDArray[np.uint64]) -> NDArray[np.int64]:
    """Return the numbers of lines."""
    return (checksums >> _HALF).astype(np.int64)


def values_checksum(values: Array, before: int = 0) -> int:
    """Return the checksum of some numbers.

    Parameters
    ----------
    values : array
        The numbers; a copy is made only if they are not contiguous.
    before : int
        Checksum of the preceding numbers; the result is the checksum of all.
    """
    return zlib.crc32(np.ascontiguousarray(values).data, before)
