"""Output files: found writable before work begins, and written whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from spheretwin.models.errors import InputError, SpheretwinError


def check_writable(path: Path) -> None:
    """Find out whether a file can be put at `path`, leaving no trace.

    Raises
    ------
    InputError
        A folder or something else than a file is there, or its folder is missing or read-only.
    """
    if path.is_dir():
        raise InputError(f"output: expected a file name, received the folder {path}")
    if path.exists() and not path.is_file():
        raise InputError(f"output: expected a regular file, received {path}")
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        os.close(handle)
        os.unlink(temporary)
        if path.exists():
            path.open("ab").close()
    except OSError as error:
        raise InputError(f"output: expected a writable path, {error}") from None


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
    target = path.resolve()
    check_writable(target)
    temporary = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        yield temporary
        os.replace(temporary, target)
    except OSError as error:
        raise SpheretwinError(f"output: {path} could not be written, {error}") from None
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


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
        raise InputError(f"output: expected a writable folder, {error}") from None
