"""Where trials are kept: Optuna's journal in one file, which one process writes at a time.

Any Optuna opens it beside this one, to look at the trials in its own ways. A line that was torn when its
process was killed is dropped before anything is added behind it.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, BinaryIO, cast

from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.base.wording import without_breaks
from spheretwin.twin.study.kept.lock import lock

if TYPE_CHECKING:
    from optuna.storages import BaseStorage

NAME = "trials.jsonl"


def optuna() -> ModuleType:
    """Optuna, which is slow to import and no part of what every user has.

    Raises
    ------
    InputError
        It is not installed.
    """
    try:
        import optuna
    except ImportError:
        raise InputError(
            "study: expected the extra `spheretwin[tune]` to look for gains,"
            " received an installation without optuna"
        ) from None
    return optuna


@contextmanager
def opened(path: Path) -> Iterator[BaseStorage]:
    """Storage in a file, made or gone on with; Optuna says nothing meanwhile but what is wrong.

    Raises
    ------
    InputError
        Another process writes it, or it is none.
    SpheretwinError
        It could not be written, as on a full disk; what was written before is kept.
    """
    module = optuna()
    verbosity = module.logging.get_verbosity()
    module.logging.set_verbosity(module.logging.WARNING)
    try:
        with _held(path) as file:
            _drop_torn_line(file, path)
            yield _read(module, path)
    except OSError as error:
        raise SpheretwinError(
            f"study: {path} could not be written, {error.strerror or error}; the trials before are kept"
        ) from None
    finally:
        module.logging.set_verbosity(verbosity)


class _Held:
    """A lock for Optuna, which takes and gives it back at each line: the process has one for all of them."""

    def acquire(self) -> bool:
        return True

    def release(self) -> None:
        pass


@contextmanager
def _held(path: Path) -> Iterator[BinaryIO]:
    try:
        file = path.open("r+b" if path.exists() else "x+b")
    except OSError as error:
        raise InputError(f"study: expected a folder for its trials, {without_breaks(error)}") from None
    with file:
        try:
            lock(file)
        except OSError:
            raise InputError(
                f"study: expected one process at a time, received {path}, which another one writes"
            ) from None
        yield file


def _drop_torn_line(file: BinaryIO, path: Path) -> None:
    content = file.read()
    whole = content[: content.rfind(b"\n") + 1]
    try:
        if whole:  # Optuna finds any line but the last one itself
            json.loads(whole[whole[:-1].rfind(b"\n") + 1 :])
    except ValueError as error:
        raise _no_trials(path, error) from None
    file.truncate(len(whole))


def _read(module: ModuleType, path: Path) -> BaseStorage:
    journal = module.storages.journal
    try:
        return journal.JournalStorage(journal.JournalFileBackend(str(path), cast(Any, _Held())))
    except OSError:
        raise
    except Exception as error:  # whatever its parser meets in a file that is none of its own
        raise _no_trials(path, error) from None


def _no_trials(path: Path, error: Exception) -> InputError:
    return InputError(
        f"study: expected trials of Optuna, received {path} ({type(error).__name__});"
        " remove it, or write into another folder"
    )
