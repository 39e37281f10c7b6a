"""Output files: found writable before work begins, and written whole or not at all."""

from __future__ import annotations

import os
import secrets
import shutil
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple, Protocol

from spheretwin.models.base.errors import InputError, SpheretwinError, without_breaks


class OutputFile:
    """A file that is written under a hidden name of its own beside the place where it is to appear.

    Whoever else writes to the same place at the same time has another hidden name: each file is whole, and
    the last to be kept stays. A link stays a link: the file it points to is replaced.

    Parameters
    ----------
    target : Path
        Where the file is to appear.

    Attributes
    ----------
    path : Path
        Where to write it; an empty file is there.

    Raises
    ------
    InputError
        No file can be made there.
    """

    def __init__(self, target: Path) -> None:
        check_writable(target)
        self._target = _behind_links(target)
        self.path = _hidden(self._target)
        try:
            self.path.open("xb").close()  # unlike `tempfile`, with the permissions of any new file
        except OSError as error:
            raise InputError(f"output: expected a writable path, {without_breaks(error)}") from None

    def keep(self) -> None:
        """Put the file in its place, with the permissions of the file that it replaces.

        Raises
        ------
        SpheretwinError
            It cannot be put there, as where a folder has come in between; it stays under its hidden name.
        """
        try:
            with suppress(FileNotFoundError):
                shutil.copymode(self._target, self.path)
            os.replace(self.path, self._target)
        except OSError as error:
            raise SpheretwinError(
                f"output: {self._target} could not be written, {error.strerror or error}"
            ) from None

    def discard(self) -> None:
        """Remove the file, unless it was kept."""
        with suppress(OSError):
            self.path.unlink(missing_ok=True)


class PartialFile(NamedTuple):
    """What there is of a file that is being written."""

    path: Path
    """Where it is."""
    target: Path
    """Name that the complete file was to have."""
    rows: int
    """Rows of telemetry in it."""


class FileWriter(Protocol):
    """Writer of a file that can be recovered when it was not completed."""

    def partial(self) -> PartialFile | None:
        """Flush the rows that wait in memory; return what can be recovered then, if there are rows.

        It is called in another thread than the writer's, before the process ends.
        """


class OpenFiles:
    """Files that this process is writing."""

    def __init__(self) -> None:
        self._writers: list[FileWriter] = []
        self._lock = threading.Lock()

    def add(self, writer: FileWriter) -> None:
        """Add the writer of a file that was begun."""
        with self._lock:
            self._writers.append(writer)

    def remove(self, writer: FileWriter) -> None:
        """Remove the writer of a file that is complete, or was given up."""
        with self._lock, suppress(ValueError):
            self._writers.remove(writer)

    def partial(self) -> Iterator[PartialFile]:
        """Flush all files; yield what can be recovered of each."""
        with self._lock:
            writers = list(self._writers)
        for writer in writers:
            if file := writer.partial():
                yield file


OPEN_FILES = OpenFiles()


def check_writable(path: Path) -> None:
    """Find out whether a file can be put at `path`, leaving no trace.

    Raises
    ------
    InputError
        A folder or something else than a file is there, or its folder is missing or read-only.
    """
    target = _behind_links(path)
    try:
        if target.is_dir():
            raise InputError(f"output: expected a file name, received the folder {path}")
        if target.exists() and not target.is_file():
            raise InputError(f"output: expected a regular file, received {path}")
        probe = _hidden(target)
        probe.open("xb").close()
        probe.unlink()
        if target.exists():
            target.open("ab").close()
    except OSError as error:
        raise InputError(f"output: expected a writable path, {without_breaks(error)}") from None


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path`; it takes the name `path` when the block ends well.

    A link stays a link: the file it points to is replaced.

    Raises
    ------
    InputError
        No file can be made there.
    SpheretwinError
        Writing failed, as on a full disk; what was at `path` before is untouched.
    """
    output = OutputFile(path)
    try:
        yield output.path
        output.keep()
    except OSError as error:
        raise SpheretwinError(f"output: {path} could not be written, {without_breaks(error)}") from None
    finally:
        output.discard()


def make_folder(path: Path) -> None:
    """Make a folder for output files, unless it is there, and find out whether it takes them.

    Raises
    ------
    InputError
        It cannot be made or written to.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise InputError(f"output: expected a writable folder, {without_breaks(error)}") from None


def _hidden(target: Path) -> Path:
    """A name beside a file that nobody else has; none that is made of the file's name elsewhere is longer."""
    return target.with_name(f".{target.name}.{secrets.token_hex(8)}.part")


def _behind_links(path: Path) -> Path:
    try:
        return path.resolve()
    except (OSError, RuntimeError):  # the latter until Python 3.13
        raise InputError(f"output: expected a file name, received {path}, a link in a circle") from None
