"""A file that one process writes at a time: a lock that goes with the process, however it ends."""

from __future__ import annotations

from typing import BinaryIO

try:
    import fcntl
except ImportError:  # Windows, which has `msvcrt` instead
    fcntl = None  # type: ignore[assignment] # a module to the checker, and asked for before each use

BEYOND = 1 << 62
"""Byte that is locked where a lock keeps others from reading: one that no file has."""


def lock(file: BinaryIO) -> None:
    """Take the lock of a file until it is closed.

    Raises
    ------
    OSError
        Another process has it.
    """
    if fcntl is not None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return
    import msvcrt

    place = file.tell()
    file.seek(BEYOND)
    try:
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
    finally:
        file.seek(place)
