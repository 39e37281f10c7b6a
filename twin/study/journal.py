"""Provenance of the results of a study by digests, and the journal of its finished rows or trials."""

from __future__ import annotations

import hashlib
import json
import os
import sys
import zlib
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.cache import sources_digest
from spheretwin.models.base.errors import InputError, SpheretwinError, without_breaks
from spheretwin.models.base.user_code import file_of, is_reference
from spheretwin.models.telemetry.run_record import versions
from spheretwin.records import provenance
from spheretwin.scenario import reading
from spheretwin.study.grid import Row
from spheretwin.study.row import RowResult, Rows


def provenance_of(rows: Rows) -> dict[str, str]:
    """Digests of study, files and sources, and the version of each package.

    The digest of a file is of its content, not of its path: the folder of a study may be moved.
    """
    study = rows.study.model_dump(mode="json", exclude={"description"})
    return {
        **rows.block.arithmetic,
        "study": _digest(study),
        "files": _digest(list(_contents(rows))),
        "sources": sources_digest(),
        **versions(),
    }


def digest_of(rows: Rows) -> str:
    """Digest of everything that results depend on."""
    return _digest(provenance_of(rows))


def _digest(content: Any) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _contents(rows: Rows) -> Iterator[Any]:
    """Values of the base and of the axes, with the content of each file instead of its path."""
    study = rows.study
    yield reading.replace_files(rows.base.model_dump(mode="json"), _content)
    named = [(axis.field, value) for axis in study.axis for value in getattr(axis, "values", ())]
    named += [("controller", dict(law)) for law in study.law]
    for dotted, value in named:
        if isinstance(value, str | list | dict):  # a number names no file
            field = reading.single_field(dotted, reading.resolve_value_paths(study.folder, dotted, value))
            yield reading.replace_files(field, _content)
    for name in study.metrics:
        if is_reference(name):
            yield _content(study.path(name), "metrics")


def _content(path: str, dotted: str) -> str:
    if is_reference(path):
        return f"{provenance.digest(dotted, file_of(path))}:{path.rpartition(':')[2]}"
    return str(provenance.digest(dotted, path))


if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

BEYOND = 1 << 62
"""Locked byte, beyond the end of any file: on Windows a lock prevents others from reading."""


def lock(file: BinaryIO) -> None:
    """Lock a file until it is closed.

    Raises
    ------
    OSError
        Another process has locked it.
    """
    if sys.platform == "win32":
        place = file.tell()
        file.seek(BEYOND)
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        finally:
            file.seek(place)
    else:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


NAME = "journal.jsonl"

MISSING = 0
"""Offset of a row that is not finished; the first line is there. Zeros take no memory until overwritten."""


class Journal:
    """Results of a study by the numbers of its rows, or of a tuning by those of its trials.

    Parameters
    ----------
    path : Path
        New, or continued.
    digest : str
        Digest of everything that results depend on.
    rows : int
        Number of rows of the study, or largest number of trials.

    Attributes
    ----------
    torn : bool
        Whether a torn last line was dropped.
    damaged : int
        Damaged lines, which were skipped.

    Raises
    ------
    InputError
        It belongs to another study, another process writes it, or it is no journal.
    SpheretwinError
        It could not be written, as on a full disk.
    """

    def __init__(self, path: Path, digest: str, rows: int) -> None:
        self.path, self.torn, self.damaged = path, False, 0
        self._head = json.dumps({"journal": 1, "digest": digest}).encode() + b"\n"
        self._offsets: NDArray[np.int64] = np.zeros(rows, dtype=np.int64)
        self._end = 0
        self._file = _opened(path)
        try:
            self._begin(digest)
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file, for another process to continue it."""
        self._file.close()

    def done(self, below: int | None = None) -> int:
        """Number of finished rows below a number; of all unless given."""
        return int(np.count_nonzero(self._offsets[:below]))

    def has(self, number: int) -> bool:
        """Whether a row is finished."""
        return bool(self._offsets[number] != MISSING)

    def add(self, row: Row, result: RowResult) -> None:
        """Store a result.

        Raises
        ------
        SpheretwinError
            It could not be written, as on a full disk; earlier results are stored.
        """
        self.append(row.number, [row.key, *result])

    def append(self, number: int, record: Sequence[Any]) -> None:
        """Store a record in JSON types under a number; errors as for `add`."""
        offset = self._end
        self._write(_line([number, *record]))
        self._offsets[number] = offset

    def results(self) -> Iterator[tuple[int, RowResult]]:
        """Finished rows in the order of the study: the number of each, and its result."""
        return ((number, RowResult(*record[1:])) for number, record in self.records())

    def records(self) -> Iterator[tuple[int, list[Any]]]:
        """Yield the records with their numbers, in the order of the numbers."""
        with self.path.open("rb") as file:
            for number in np.flatnonzero(self._offsets):
                file.seek(int(self._offsets[number]))
                yield int(number), json.loads(file.readline())[1:-1]

    def _begin(self, digest: str) -> None:
        with self.path.open("rb") as file:
            head = file.readline()
            if self._head.startswith(head) and head != self._head:  # new, or torn
                self._write(self._head)
                return
            stored = _parsed(head)
            if not isinstance(stored, dict) or "journal" not in stored:
                raise InputError(f"study: expected a journal of a study, received {self.path}")
            if stored.get("digest") != digest:
                raise InputError(
                    f"study: expected {self.path} to be a journal of this study with these sources and"
                    " versions, received one of others; remove it, or write into another folder"
                )
            self._end = len(head)
            for line in file:
                self._take(line)
        self._file.truncate(self._end)

    def _take(self, line: bytes) -> None:
        if not line.endswith(b"\n"):
            self.torn = True
            return
        number = _number(line)
        if number is None or not 0 <= number < len(self._offsets):
            self.damaged += 1
        else:
            self._offsets[number] = self._end
        self._end += len(line)

    def _write(self, line: bytes) -> None:
        """Append a line completely or not at all."""
        try:
            self._file.seek(self._end)
            rest = memoryview(line)
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            with suppress(OSError):  # a torn line is dropped when it is read
                self._file.truncate(self._end)
            raise SpheretwinError(
                f"study: {self.path} could not be written, {error.strerror or error};"
                " the rows before are kept"
            ) from None
        self._end += len(line)


def _opened(path: Path) -> BinaryIO:
    """Open the file without a buffer: a failed write is not repeated."""
    try:
        file = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o666), "r+b", 0)
    except OSError as error:
        raise InputError(f"study: expected a folder for its journal, {without_breaks(error)}") from None
    try:
        lock(file)
    except OSError:
        file.close()
        raise InputError(
            f"study: expected one process at a time, received {path}, which another one writes"
        ) from None
    return file


def _line(record: list[Any]) -> bytes:
    """Line of JSON whose last entry is a checksum of the others."""
    body = json.dumps(record).encode()[:-1]
    return body + b', "%08x"]\n' % zlib.crc32(body)


def _number(line: bytes) -> int | None:
    """Row of a line; None if it is damaged."""
    body = line[: -len(', "00000000"]\n')]
    parsed = _parsed(line) if line[len(body) :] == b', "%08x"]\n' % zlib.crc32(body) else None
    return parsed[0] if isinstance(parsed, list) else None


def _parsed(line: bytes) -> Any:
    try:
        return json.loads(line)
    except ValueError:
        return None
