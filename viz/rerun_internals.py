"""The messages of what Rerun's encoder gives at each reading, which is a whole recording every time."""

from __future__ import annotations

import os
import re
import select
import shutil
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from io import FileIO
from mmap import ACCESS_READ, mmap
from pathlib import Path
from threading import Lock, Thread
from typing import BinaryIO, NamedTuple

import rerun_cli

from spheretwin.models.base.errors import InputError, SpheretwinError, without_breaks

# Rerun's file format 2: magic, version and options, then messages, each with its kind and its length before
# it; the one that ends a file says where all others are.
HEADER_BYTES = 12
_MAGIC = b"RRF2"
_BEFORE_A_MESSAGE = struct.Struct("<QQ")
_END = 0


def messages(encoded: bytes) -> bytes:
    """The messages of what is encoded, without what is before the first and behind the last.

    Parameters
    ----------
    encoded : bytes
        A whole recording, or what comes behind the beginning of one.
    """
    first = place = HEADER_BYTES if encoded.startswith(_MAGIC) else 0
    while place + _BEFORE_A_MESSAGE.size <= len(encoded):
        kind, length = _BEFORE_A_MESSAGE.unpack_from(encoded, place)
        if kind == _END:
            break
        place += _BEFORE_A_MESSAGE.size + length
    return encoded[first:place]


# Rerun's file format 2: magic, version and options, then messages, each with its kind and its length before
# it. The one that ends a file is the footer, by which a reader finds the others.
_FILE_MAGIC, _HEADER_BYTES = b"RRF2", 12

_LAST_KIND, _CHUNK = 0, 2
_KINDS = range(4)

# Bytes of a chunk's message that are enough for the identity of its recording.
_SIGNATURE_BYTES = 256

# Behind the footer stands where it is, which ends so, with a version.
_AFTER_FOOTER_BYTES = 32
_FOOTER_MAGIC, _FOOTER_MAGIC_BYTES = b"RRF2FOOT", 12


class Extent(NamedTuple):
    """How much of a file is whole."""

    whole_bytes: int
    """Up to the end of the last whole message."""
    ended: bool
    """Whether the footer is among them."""
    torn: bool
    """Whether something is behind them."""


def extent(path: Path) -> Extent:
    """Find out how far a recording's messages are whole; only their lengths are read.

    Raises
    ------
    InputError
        It cannot be read, has not even the beginning of a recording, or a message is damaged: its kind or
        length is not what was written.
    """
    try:
        with path.open("rb") as file:
            size = path.stat().st_size
            if file.read(_HEADER_BYTES)[: len(_FILE_MAGIC)] != _FILE_MAGIC or size < _HEADER_BYTES:
                raise InputError(f"recording {path}: expected a Rerun recording, received another file")
            place, ended, signature = _HEADER_BYTES, False, b""
            while not ended and len(before := file.read(_BEFORE_A_MESSAGE.size)) == _BEFORE_A_MESSAGE.size:
                kind, length = _BEFORE_A_MESSAGE.unpack(before)
                if kind not in _KINDS:
                    raise _damaged(path, place)
                if (next_place := place + len(before) + length) > size:
                    break
                if kind == _CHUNK and not signature:
                    signature = _signature(file.read(min(length, _SIGNATURE_BYTES)))
                place, ended = next_place, kind == _LAST_KIND
                file.seek(place)
            if _has_more_messages(file, place, size, ended=ended, signature=signature):
                raise _damaged(path, place)
    except OSError as error:
        raise InputError(f"recording {path}: expected a readable file, {error.strerror or error}") from None
    return Extent(place, ended, not ended and place < size)


def _signature(payload: bytes) -> bytes:
    """What every chunk of one recording begins with: its identity, with the length of that before it."""
    return payload[: 2 + payload[1]] if len(payload) > 1 else b""


def _has_more_messages(file: BinaryIO, place: int, size: int, *, ended: bool, signature: bytes) -> bool:
    """Whether there are more messages behind a place at which the messages seem to end.

    A process that was killed leaves a part of one message at most, and behind the footer is its place alone.
    """
    if ended:
        return size - place > _AFTER_FOOTER_BYTES
    if size - place <= _BEFORE_A_MESSAGE.size or not signature:
        return False
    file.seek(-_FOOTER_MAGIC_BYTES, os.SEEK_END)
    if file.read().startswith(_FOOTER_MAGIC):
        return True
    # A chunk is known by its kind, a length below 2^40 and the identity.
    chunk = _CHUNK.to_bytes(8, "little") + b".{5}\\0{3}" + re.escape(signature)
    with mmap(file.fileno(), 0, access=ACCESS_READ) as content:
        return re.compile(chunk, re.DOTALL).search(content, place + 1) is not None


def _damaged(path: Path, place: int) -> InputError:
    return InputError(
        f"recording {path}: expected the messages that were written, received something else at byte {place}:"
        " the file is damaged, or was changed by another program"
    )


@contextmanager
def whole_messages(path: Path) -> Iterator[tuple[Path, Extent]]:
    """Give a path that has the whole messages of a recording alone; a copy, where it is torn behind them.

    Raises
    ------
    InputError
        As `extent`, or a copy cannot be made.
    """
    result = extent(path)
    if not result.torn:
        yield path, result
        return
    with tempfile.TemporaryDirectory(prefix="spheretwin-") as folder:
        copy = Path(folder) / "whole.rrd"
        try:
            shutil.copyfile(path, copy)
            with copy.open("r+b") as file:
                file.truncate(result.whole_bytes)
        except OSError as error:
            raise InputError(f"recording {path}: expected room for a copy, {without_breaks(error)}") from None
        yield copy, result


PIPE_PATHS = Path("/dev/fd")
"""Where a pipe has a path, by its number; there is none on Windows, where Rerun must write files itself."""

_BLOCK_BYTES = 1 << 20


class FilePipe:
    """A pipe whose far end is written to a file.

    Rerun writes files itself, but once a full disk has ended its writer, it waits for it forever at the
    next flush, and tells the cause to its own log alone. It never learns of a disk at the end of a pipe.

    Parameters
    ----------
    path : Path
        File to write.

    Attributes
    ----------
    path : Path
        Where to write to the pipe.
    error : OSError or None
        Why the file could not be written or closed; from then on what comes is dropped.

    Raises
    ------
    OSError
        The file or the pipe cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        file = path.open("wb", buffering=0)
        try:
            reading, self._writing = os.pipe()
        except OSError:
            file.close()
            raise
        self.path = PIPE_PATHS / str(self._writing)
        self.error: OSError | None = None
        self._block = Lock()
        self._thread = Thread(target=self._copy, args=(reading, file), name="recording file", daemon=True)
        self._thread.start()

    def drain(self, timeout_s: float) -> None:
        """Wait until what was written to the pipe by now is in the file, but no longer than a time."""
        import fcntl  # not on Windows, where there is no such pipe
        import termios

        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            with self._block:
                count = fcntl.ioctl(self._writing, termios.FIONREAD, b"\0" * 4)
            if not any(count):
                return
            time.sleep(0.01)

    def close(self) -> None:
        """Wait until all that was written to the pipe is in the file."""
        os.close(self._writing)
        self._thread.join()

    def _copy(self, reading: int, file: FileIO) -> None:
        with open(reading, "rb", buffering=0) as pipe:
            try:
                with file:
                    while self._copy_block(pipe, file):
                        pass
            except OSError as error:
                self.error = error
                while pipe.read(_BLOCK_BYTES):  # else Rerun would wait for room in the pipe
                    pass

    def _copy_block(self, pipe: FileIO, file: FileIO) -> bool:
        """Copy a block; False at the end of the pipe."""
        select.select([pipe], [], [])
        with self._block:  # what is no longer in the pipe is in the file when this is released
            block = pipe.read(_BLOCK_BYTES)
            _write_all(file, block)
        return bool(block)


def _write_all(file: FileIO, block: bytes) -> None:
    rest = memoryview(block)
    while rest:
        rest = rest[file.write(rest) :]


PROGRAM = Path(rerun_cli.__file__).with_name("rerun.exe" if sys.platform == "win32" else "rerun")

# With less it has found something that the reader finds again, and says on one line.
_PANICS = 100


def check_readable(path: Path, named: Path) -> None:
    """Let a process of its own read a recording first; of 10 MB that takes 30 ms.

    Parameters
    ----------
    path : Path
        What is read.
    named : Path
        What a complaint names.

    Raises
    ------
    InputError
        The process did not live through it.
    SpheretwinError
        Rerun's program cannot be started.
    """
    command = [str(PROGRAM), "rrd", "verify", "--check-footers=false", str(path)]
    try:
        ended = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            check=False,
        ).returncode
    except OSError as error:
        raise SpheretwinError(
            f"recording {named}: expected Rerun at {PROGRAM}, {without_breaks(error)}"
        ) from None
    if ended < 0 or ended >= _PANICS:
        raise InputError(
            f"recording {named}: expected one of a run, received one so damaged that Rerun ends at it"
        )
