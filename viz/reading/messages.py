"""The messages of a recording's file, and how far they are whole in one that a killed process left."""

from __future__ import annotations

import os
import re
import shutil
import struct
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import BinaryIO, NamedTuple

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.wording import without_breaks

# Rerun's file format 2: magic, version and options, then messages, each with its kind and its length before
# it. The one that ends a file is the footer, by which a reader finds the others.
_MAGIC, _HEADER_BYTES = b"RRF2", 12
_BEFORE_A_MESSAGE = struct.Struct("<QQ")
_END, _CHUNK = 0, 2
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
            if file.read(_HEADER_BYTES)[: len(_MAGIC)] != _MAGIC or size < _HEADER_BYTES:
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
                place, ended = next_place, kind == _END
                file.seek(place)
            if _goes_on(file, place, size, ended=ended, signature=signature):
                raise _damaged(path, place)
    except OSError as error:
        raise InputError(f"recording {path}: expected a readable file, {error.strerror or error}") from None
    return Extent(place, ended, not ended and place < size)


def _signature(payload: bytes) -> bytes:
    """What every chunk of one recording begins with: its identity, with the length of that before it."""
    return payload[: 2 + payload[1]] if len(payload) > 1 else b""


def _goes_on(file: BinaryIO, place: int, size: int, *, ended: bool, signature: bytes) -> bool:
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
    found = extent(path)
    if not found.torn:
        yield path, found
        return
    with tempfile.TemporaryDirectory(prefix="spheretwin-") as folder:
        copy = Path(folder) / "whole.rrd"
        try:
            shutil.copyfile(path, copy)
            with copy.open("r+b") as file:
                file.truncate(found.whole_bytes)
        except OSError as error:
            raise InputError(f"recording {path}: expected room for a copy, {without_breaks(error)}") from None
        yield copy, found
