"""User code: an object in a Python file, named ``FILE.py:NAME`` on a command line or in a scenario."""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from spheretwin.models.base.errors import InputError, did_you_mean, shown, without_breaks
from spheretwin.models.base.files import regular_file

_REFERENCE = re.compile(r"(?P<file>.+\.py):(?P<name>[^\W\d]\w*)", re.DOTALL)


def is_reference(text: object) -> bool:
    """Return True if a text has the form ``FILE.py:NAME``."""
    return isinstance(text, str) and _REFERENCE.fullmatch(text) is not None


def file_of(reference: str) -> str:
    """Return the file of a reference."""
    return reference.rpartition(":")[0]


def short_names(texts: Sequence[str]) -> list[str]:
    """Return short names of references: file name and object, with as many folders as tell two files apart.

    Parameters
    ----------
    texts : sequence of str
        References, in which one file may be written in several ways, and other names, which stay.
    """
    parts = {
        text: Path(os.path.abspath(os.path.expanduser(file_of(text)))).parts
        for text in texts
        if is_reference(text)
    }

    def name(text: str, depth: int) -> str:
        return "/".join(parts[text][-depth:]) + ":" + text.rpartition(":")[2]

    def short(text: str) -> str:
        others = [other for other in parts if parts[other] != parts[text]]
        for depth in range(1, len(parts[text])):
            if all(name(text, depth) != name(other, depth) for other in others):
                return name(text, depth)
        return text

    return [short(text) if text in parts else text for text in texts]


def load_function(reference: str, what: str) -> Callable[..., Any]:
    """Load the function that a reference names; see `load_named`.

    Raises
    ------
    InputError
        The object does not exist, or is not a function.
    """
    function = load_named(reference, what)
    if not callable(function):
        raise InputError(f"{what}: expected a function, received {reference}, {shown(function)}")
    return function


def load_named(reference: str, what: str) -> Any:
    """Load the object that a reference names; see `load_with_digest`.

    Raises
    ------
    InputError
        The object does not exist.
    """
    return load_with_digest(reference, what)[0]


def load_with_digest(reference: str, what: str) -> tuple[Any, str]:
    """Load the object that a reference names, and compute the digest of its file.

    Parameters
    ----------
    reference : str
        ``FILE.py:NAME``; ``~`` is the user's home. The file is run once for each content: the next call
        after an edit runs it again.
    what : str
        Kind of object, as the first words of a message.

    Raises
    ------
    InputError
        The text is not a reference, the file cannot be read or run, or does not define the name.
    """
    match = _REFERENCE.fullmatch(reference)
    if match is None:
        raise InputError(f"{what}: expected path/to/file.py:name, received {shown(reference)}")
    path, name = Path(os.path.expanduser(match["file"])), match["name"]
    if not (getattr(_THREAD, "only_loaded", False) and path in _LOADED):
        _LOADED[path] = _read(path, what)
    module, digest = _LOADED[path]
    defined = vars(module)
    if name not in defined:
        candidates = [key for key, value in defined.items() if callable(value) and _is_of(module, value)]
        expected = f"one of {', '.join(candidates)}" if candidates else "a function"
        raise InputError(
            f"{what}: expected {expected} in {path}, received {name}{did_you_mean(name, candidates)}"
        )
    return defined[name], digest


def load_again(reference: str) -> Any:
    """Run the file of a loaded object again; return the object of the new module.

    It shares no global variable with the loaded one. Within `only_loaded` the loaded object is returned.
    """
    path, name = Path(os.path.expanduser(file_of(reference))), reference.rpartition(":")[2]
    module, digest = _LOADED[path]
    if not getattr(_THREAD, "only_loaded", False):
        with _AGAIN:
            module = _run(path, _SOURCES[digest], digest, "law")
    return vars(module)[name]


@contextlib.contextmanager
def only_loaded() -> Iterator[None]:
    """Let this thread neither read nor run a file again that this process has loaded: it must not wait."""
    _THREAD.only_loaded = True
    try:
        yield
    finally:
        _THREAD.only_loaded = False


_THREAD = threading.local()

_AGAIN = threading.RLock()
"""Files run again one at a time: the working folder, which they may change, is that of the process."""

_LOADED: dict[Path, tuple[ModuleType, str]] = {}
"""Last content of each file: its module and its digest."""

_SOURCES: dict[str, bytes] = {}
"""Content of files by its digest."""


def _read(path: Path, what: str) -> tuple[ModuleType, str]:
    try:
        source = regular_file(path).read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a zero in the path
        raise InputError(f"{what}: expected a readable file of Python, {without_breaks(error)}") from None
    digest = hashlib.sha256(source).hexdigest()
    _SOURCES[digest] = source
    return _module(path, source, digest, what), digest


def _is_of(module: ModuleType, value: Any) -> bool:
    """Return True if an object was defined in a module, not imported into it."""
    return getattr(value, "__module__", None) == module.__name__


@lru_cache(maxsize=32)
def _module(path: Path, source: bytes, digest: str, what: str) -> ModuleType:
    """Run a file as a module, once for each content."""
    return _run(path, source, digest, what)


def _run(path: Path, source: bytes, digest: str, what: str) -> ModuleType:
    """Run a file as a module.

    It is compiled from its content: the import system would use an older `.pyc` for a file that was edited
    within the same second, and would create a cache folder. A change of the working folder ends with it:
    paths of the caller are relative to the folder before.
    """
    module = ModuleType(f"spheretwin_user_{path.stem}_{digest[:12]}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # dataclasses and pickles look their module up by its name
    try:
        # Its output must not mix with the figures on stdout.
        with contextlib.chdir("."), contextlib.redirect_stdout(sys.stderr):
            exec(compile(source, str(path), "exec"), vars(module))
    except KeyboardInterrupt:
        del sys.modules[module.__name__]
        raise
    except BaseException as error:  # the user's code may raise anything
        del sys.modules[module.__name__]
        raise InputError(
            f"{what}: expected a file of Python that runs, received {path}: {_error_text(error, path)}"
        ) from None
    return module


def _error_text(error: BaseException, path: Path) -> str:
    """Return the error and the line of the file."""
    if isinstance(error, SyntaxError) and error.filename == str(path):
        return f"{type(error).__name__} in line {error.lineno}: {error.msg}"
    lines = [
        frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)
    ]
    place = f" in line {lines[-1]}" if lines else ""
    return f"{type(error).__name__}{place}: {without_breaks(error)}"
