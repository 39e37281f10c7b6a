"""Files: inputs are regular files; outputs are checked before work begins, and written completely or not."""

from __future__ import annotations

import os
import secrets
import shutil
import stat
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple, Protocol

from spheretwin.models.base.errors import HIDDEN, InputError, SpheretwinError, without_breaks


class OutputFile:
    """File that is written under a unique hidden name in the folder of its target.

    Another writer of the same target has another hidden name: each file is complete, and the last one
    remains. A link stays a link: the file it points to is replaced.

    Parameters
    ----------
    target : Path
        Path of the complete file.
    suffix : str
        As in `check_writable`.

    Attributes
    ----------
    path : Path
        Hidden path to write to; an empty file exists there.

    Raises
    ------
    InputError
        No file can be made there, or its name is that of another format.
    """

    def __init__(self, target: Path, suffix: str = "") -> None:
        check_writable(target, suffix)
        self._target = _behind_links(target)
        self.path = _hidden(self._target)
        try:
            self.path.open("xb").close()  # unlike `tempfile`, with the permissions of any new file
        except OSError as error:
            raise _not_writable(target, error) from None

    def keep(self) -> None:
        """Move the file to its target, with the permissions of the file that it replaces.

        Raises
        ------
        SpheretwinError
            It cannot be moved, for example if a folder now has that name; it stays under its hidden name.
        """
        try:
            with suppress(FileNotFoundError):
                shutil.copymode(self._target, self.path)
            os.replace(self.path, self._target)
        except OSError as error:
            raise SpheretwinError(f"output: {self._target} could not be written, {_cause(error)}") from None

    def discard(self) -> None:
        """Remove the file, unless it was moved to its target."""
        with suppress(OSError):
            self.path.unlink(missing_ok=True)


class PartialFile(NamedTuple):
    """Incomplete file that is being written."""

    path: Path
    """Present path."""
    target: Path
    """Intended path of the complete file."""
    rows: int
    """Rows of telemetry in the file."""


class FileWriter(Protocol):
    """Writer of a file that can be recovered when it was not completed."""

    def partial(self) -> PartialFile | None:
        """Flush the rows in memory; return the recoverable file, if there are rows.

        It is called in another thread than that of the writer, before the process ends.
        """


class OpenFiles:
    """Files that this process is writing."""

    def __init__(self) -> None:
        self._writers: list[FileWriter] = []
        self._lock = threading.Lock()

    def add(self, writer: FileWriter) -> None:
        """Add the writer of a new file."""
        with self._lock:
            self._writers.append(writer)

    def remove(self, writer: FileWriter) -> None:
        """Remove the writer of a complete or abandoned file."""
        with self._lock, suppress(ValueError):
            self._writers.remove(writer)

    def partial(self) -> Iterator[PartialFile]:
        """Flush all files; yield the recoverable file of each."""
        with self._lock:
            writers = list(self._writers)
        for writer in writers:
            if file := writer.partial():
                yield file


OPEN_FILES = OpenFiles()


def regular_file(path: str | Path) -> Path:
    """Return the path of an input file that has an end; a file without one would be read for ever.

    Raises
    ------
    OSError
        It does not exist, or it is a folder, a pipe, a socket or a device, or a link to one.
    """
    mode = os.stat(path).st_mode
    if not stat.S_ISREG(mode):
        raise OSError(0, f"it is {_KINDS.get(stat.S_IFMT(mode), 'a device')}, not a regular file", str(path))
    return Path(path)


_KINDS = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a named pipe", stat.S_IFSOCK: "a socket"}


def check_writable(path: Path, suffix: str = "") -> None:
    """Check that a file can be written at `path`, without a change on disk.

    Parameters
    ----------
    path : Path
    suffix : str
        End of the name that belongs to the format, such as ``.parquet``; any unless given.

    Raises
    ------
    InputError
        The path is not that of a file, its name is that of another format, or its folder is missing or
        read-only.
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
        raise _not_writable(path, error) from None
    if suffix and path.suffix != suffix:
        raise InputError(f"output: expected a name that ends in {suffix}, received {path}")


@contextmanager
def whole_file(path: Path, suffix: str = "") -> Iterator[Path]:
    """Yield a temporary path in the same folder; it is renamed to `path` if the block succeeds.

    A link stays a link: the file it points to is replaced. The suffix is that of `check_writable`.

    Raises
    ------
    InputError
        No file can be made there, or its name is that of another format.
    SpheretwinError
        Writing failed, for example on a full disk; an earlier file at `path` is unchanged.
    """
    output = OutputFile(path, suffix)
    try:
        yield output.path
        output.keep()
    except OSError as error:
        raise SpheretwinError(f"output: {path} could not be written, {_cause(error)}") from None
    finally:
        output.discard()


def make_folder(path: Path) -> None:
    """Create a folder for output files, if it does not exist, and check that it is writable.

    Raises
    ------
    InputError
        It cannot be created or written to.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise InputError(f"output: expected a writable folder, {without_breaks(error)}") from None


def _not_writable(path: Path, error: OSError) -> InputError:
    return InputError(f"output: expected a writable path, {_cause(error)}: {path}")


def _cause(error: OSError) -> str:
    """Return the cause of an error without the file, which has a hidden name."""
    return os.strerror(error.errno) if error.errno else without_breaks(error)


def _hidden(target: Path) -> Path:
    """Return a unique hidden path in the folder of a file; no other derived name is longer."""
    return target.with_name(f".{target.name}.{secrets.token_hex(8)}{HIDDEN}")


def _behind_links(path: Path) -> Path:
    try:
        return path.resolve()
    except (OSError, RuntimeError):  # the latter until Python 3.13
        raise InputError(f"output: expected a file name, received {path}, a link in a circle") from None
