"""Between Rerun and a file, so that a full disk is an error with a cause, and nothing waits for it."""

from __future__ import annotations

import os
from pathlib import Path
from threading import Thread

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
        Why the file could not be written; from then on what comes is dropped.
    """

    def __init__(self, path: Path) -> None:
        reading, self._writing = os.pipe()
        self.path = Path(f"/dev/fd/{self._writing}")
        self.error: OSError | None = None
        self._thread = Thread(target=self._copy, args=(reading, path), name="recording file", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Wait until all that was written to the pipe is in the file."""
        os.close(self._writing)
        self._thread.join()

    def _copy(self, reading: int, path: Path) -> None:
        with open(reading, "rb", buffering=0) as pipe, path.open("wb", buffering=0) as file:
            while block := pipe.read(_BLOCK_BYTES):
                if self.error:
                    continue
                try:
                    rest = memoryview(block)
                    while rest:
                        rest = rest[file.write(rest) :]
                except OSError as error:
                    self.error = error
