"""Pipe through which Rerun writes a file: its writer waits forever after a full disk, a pipe does not."""

from __future__ import annotations

import os
import select
import time
from contextlib import suppress
from io import FileIO
from pathlib import Path
from threading import Lock, Thread

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
            _enlarge(self._writing)
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


def _enlarge(pipe: int) -> None:
    """Let a pipe hold a block, if the system can: its thread has to wait for the interpreter less often."""
    import fcntl  # not on Windows, which has no such pipe

    if command := getattr(fcntl, "F_SETPIPE_SZ", None):
        with suppress(OSError):  # the pipes of a user have a total size
            fcntl.fcntl(pipe, command, _BLOCK_BYTES)


def _write_all(file: FileIO, block: bytes) -> None:
    rest = memoryview(block)
    while rest:
        rest = rest[file.write(rest) :]
