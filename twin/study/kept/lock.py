"""A file that one process writes at a time: a lock that goes with the process, however it ends."""

from __future__ import annotations

import sys
from typing import BinaryIO

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

BEYOND = 1 << 62
"""Byte that is locked where a lock keeps others from reading: one that no file has."""


def lock(file: BinaryIO) -> None:
    """Take the lock of a file until it is closed.

    Raises
    ------
    OSError
        Another process has it.
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
