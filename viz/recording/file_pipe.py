"""Between Rerun and a file, so that a full disk is an error with a cause, and nothing waits for it."""

from __future__ import annotations

import os
import select
import time
from io import FileIO
from pathlib import Path
from threading import Lock, Thread

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
