"""Internals of Rerun: the framing of its files (RRF2), the pipe that writes them, and its program."""

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
# it. The last message of a file is the footer, with the places of all others.
HEADER_BYTES = 12
_FILE_MAGIC = b"RRF2"
_MESSAGE_HEADER = struct.Struct("<QQ")
_FOOTER, _CHUNK = 0, 2
_KINDS = range(4)


def messages(encoded: bytes) -> bytes:
    """Return the messages of an encoded recording, without header and footer.

    Parameters
    ----------
    encoded : bytes
        A complete recording, or a later part of one.
    """
    first = place = HEADER_BYTES if encoded.startswith(_FILE_MAGIC) else 0
    while place + _MESSAGE_HEADER.size <= len(encoded):
        kind, length = _MESSAGE_HEADER.unpack_from(encoded, place)
        if kind == _FOOTER:
            break
        place += _MESSAGE_HEADER.size + length
    return encoded[first:place]


# Bytes of a chunk's message that are enough for the identity of its recording.
_SIGNATURE_BYTES = 256

# The end of a file holds the position of the footer and this magic, with a version.
_AFTER_FOOTER_BYTES = 32
_FOOTER_MAGIC, _FOOTER_MAGIC_BYTES = b"RRF2FOOT", 12


class Extent(NamedTuple):
    """Extent of the complete messages of a file."""

    whole_bytes: int
    """Bytes to the end of the last complete message."""
    ended: bool
    """True if the footer is among them."""
    torn: bool
    """True if an incomplete message follows."""


def extent(path: Path) -> Extent:
    """Return the extent of the complete messages of a recording; only their lengths are read.

    Raises
    ------
    InputError
        It cannot be read, does not begin as a recording, or a message is damaged: its kind or
        length is not a valid one.
    """
    try:
        with path.open("rb") as file:
            size = path.stat().st_size
            if file.read(HEADER_BYTES)[: len(_FILE_MAGIC)] != _FILE_MAGIC or size < HEADER_BYTES:
                raise InputError(f"recording {path}: expected a Rerun recording, received another file")
            place, ended, signature = HEADER_BYTES, False, b""
            while not ended and len(before := file.read(_MESSAGE_HEADER.size)) == _MESSAGE_HEADER.size:
                kind, length = _MESSAGE_HEADER.unpack(before)
                if kind not in _KINDS:
                    raise _damaged(path, place)
                if (next_place := place + len(before) + length) > size:
                    break
                if kind == _CHUNK and not signature:
                    signature = _signature(file.read(min(length, _SIGNATURE_BYTES)))
                place, ended = next_place, kind == _FOOTER
                file.seek(place)
            if _has_more_messages(file, place, size, ended=ended, signature=signature):
                raise _damaged(path, place)
    except OSError as error:
        raise InputError(f"recording {path}: expected a readable file, {error.strerror or error}") from None
    return Extent(place, ended, not ended and place < size)


def _signature(payload: bytes) -> bytes:
    """Return the first bytes of every chunk of one recording: its identity, with the length before it."""
    return payload[: 2 + payload[1]] if len(payload) > 1 else b""


def _has_more_messages(file: BinaryIO, place: int, size: int, *, ended: bool, signature: bytes) -> bool:
    """True if more messages follow a place at which the messages seem to end.

    A killed process leaves a part of one message at most; after the footer there is only its position.
    """
    if ended:
        return size - place > _AFTER_FOOTER_BYTES
    if size - place <= _MESSAGE_HEADER.size or not signature:
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
        f"recording {path}: expected an intact message, received other content at byte {place}:"
        " the file is damaged, or was changed by another program"
    )


@contextmanager
def whole_messages(path: Path) -> Iterator[tuple[Path, Extent]]:
    """Yield the path of a file with only the complete messages of a recording: a copy if it is incomplete.

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
"""Folder in which a pipe has a path, by its number; Windows has none, and Rerun writes files itself."""

_BLOCK_BYTES = 1 << 20


class FilePipe:
    """Pipe whose content a thread writes to a file.

    Rerun can write files itself, but after a full disk has ended its writer, it waits forever at the
    next flush, and reports the cause to its own log only. With a pipe it is independent of the disk.

    Parameters
    ----------
    path : Path
        File to write.

    Attributes
    ----------
    path : Path
        Path at which Rerun writes to the pipe.
    error : OSError or None
        Error of writing or closing the file; later content is dropped.

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
        """Wait until the present content of the pipe is in the file, or the time is over."""
        import fcntl  # not on Windows, which has no such pipe
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
        with self._block:  # content that is no longer in the pipe is in the file when this lock is released
            block = pipe.read(_BLOCK_BYTES)
            _write_all(file, block)
        return bool(block)


def _write_all(file: FileIO, block: bytes) -> None:
    rest = memoryview(block)
    while rest:
        rest = rest[file.write(rest) :]


PROGRAM = Path(rerun_cli.__file__).with_name("rerun.exe" if sys.platform == "win32" else "rerun")

# Lower codes are errors that the reader finds too and reports in one line.
_PANICS = 100


def check_readable(path: Path, named: Path) -> None:
    """Let a separate process read a recording first; 10 MB take 30 ms.

    Parameters
    ----------
    path : Path
        File to read.
    named : Path
        File that a message names.

    Raises
    ------
    InputError
        The process did not survive it.
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
            f"recording {named}: expected one of a run, received one so damaged that Rerun crashes"
        )
