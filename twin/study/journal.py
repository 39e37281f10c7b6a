"""The journal of a study: every finished row, a line each, added as it happens and never changed.

Its first line tells what the rows depend on: a digest of the study, of every file that it names, of the
package's sources and of the versions that a figure may depend on. A journal of anything else is refused. A
line that was torn when its process was killed is dropped. One process writes a journal at a time, held by a
lock that goes with the process.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.twin.study.grid import Row
from spheretwin.twin.study.row import Result

NAME = "journal.jsonl"

NOT_YET = -1


class Journal:
    """Results of a study, by the numbers of its rows.

    Parameters
    ----------
    path : Path
        Made, or gone on with.
    digest : str
        Of all that results depend on.
    rows : int
        Of the study.

    Attributes
    ----------
    torn : bool
        Whether a torn last line was dropped.

    Raises
    ------
    InputError
        It is that of another study, another process writes it, or it is no journal.
    """

    def __init__(self, path: Path, digest: str, rows: int) -> None:
        self.path, self.torn = path, False
        self._places: NDArray[np.int64] = np.full(rows, NOT_YET, dtype=np.int64)
        self._file = _opened(path)
        try:
            self._read(digest)
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    @property
    def done(self) -> int:
        """Rows that are finished."""
        return int(np.count_nonzero(self._places != NOT_YET))

    def has(self, number: int) -> bool:
        """Whether a row is finished."""
        return bool(self._places[number] != NOT_YET)

    def add(self, row: Row, result: Result) -> None:
        """Keep a result.

        Raises
        ------
        SpheretwinError
            It could not be written, as on a full disk; what was written before is kept.
        """
        place = self._end
        line = json.dumps([row.number, row.key, *result]).encode() + b"\n"
        try:
            self._file.write(line)
            self._file.flush()
        except OSError as error:
            raise SpheretwinError(
                f"study: {self.path} could not be written, {error.strerror or error};"
                f" the {self.done} rows before are kept"
            ) from None
        self._end += len(line)
        self._places[row.number] = place

    def results(self) -> Iterator[tuple[int, Result]]:
        """Every finished row in the order of the study: its number and its result."""
        with self.path.open("rb") as file:
            for number in np.flatnonzero(self._places != NOT_YET):
                file.seek(int(self._places[number]))
                yield int(number), _result(json.loads(file.readline()))

    def _read(self, digest: str) -> None:
        head = self._file.readline()
        if not head.endswith(b"\n"):  # new, or torn before it was one
            self._file.seek(0)
            self._file.truncate()
            self._file.write(json.dumps({"journal": 1, "digest": digest}).encode() + b"\n")
            self._file.flush()
            self._end = self._file.tell()
            return
        found = _parsed(head)
        if not isinstance(found, dict) or "journal" not in found:
            raise InputError(f"study: expected a journal of a study, received {self.path}")
        if found.get("digest") != digest:
            raise InputError(
                f"study: expected {self.path} to be a journal of this study with these sources and versions,"
                " received one of others; remove it, or write into another folder"
            )
        self._end = len(head)
        for line in self._file:
            if not self._take(line):
                self.torn = True
                break
        self._file.seek(self._end)
        self._file.truncate()

    def _take(self, line: bytes) -> bool:
        parsed = _parsed(line) if line.endswith(b"\n") else None
        if not isinstance(parsed, list) or not 0 <= parsed[0] < len(self._places):
            return False
        self._places[parsed[0]] = self._end
        self._end += len(line)
        return True


def _opened(path: Path) -> BinaryIO:
    try:
        file = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT, 0o666), "r+b")
    except OSError as error:
        raise InputError(f"study: expected a folder for its journal, {error}") from None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.close()
        raise InputError(
            f"study: expected one process at a time, received {path}, which another one writes"
        ) from None
    return file


def _parsed(line: bytes) -> Any:
    try:
        return json.loads(line)
    except ValueError:
        return None


def _result(parsed: list[Any]) -> Result:
    return Result(*parsed[2:])
