"""The messages of a recording's file, and how far they are whole in one that a killed process left."""

from __future__ import annotations

import shutil
import struct
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.wording import without_breaks

# Rerun's file format 2: magic, version and options, then messages, each with its kind and its length before
# it. The one that ends a file is the footer, by which a reader finds the others.
_MAGIC, _HEADER_BYTES = b"RRF2", 12
_BEFORE_A_MESSAGE = struct.Struct("<QQ")
_END = 0
_KINDS = range(4)


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
        It cannot be read, or has not even the beginning of a recording.
    """
    try:
        with path.open("rb") as file:
            size = path.stat().st_size
            if file.read(_HEADER_BYTES)[: len(_MAGIC)] != _MAGIC or size < _HEADER_BYTES:
                raise InputError(f"recording {path}: expected a Rerun recording, received another file")
            place, ended = _HEADER_BYTES, False
            while not ended and len(before := file.read(_BEFORE_A_MESSAGE.size)) == _BEFORE_A_MESSAGE.size:
                kind, length = _BEFORE_A_MESSAGE.unpack(before)
                if kind not in _KINDS or (next_place := place + len(before) + length) > size:
                    break
                place, ended = next_place, kind == _END
                file.seek(place)
    except OSError as error:
        raise InputError(f"recording {path}: expected a readable file, {error.strerror or error}") from None
    return Extent(place, ended, not ended and place < size)


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
