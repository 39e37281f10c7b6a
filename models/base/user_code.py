"""Python of the user's: an object in a file, named ``FILE.py:NAME``."""

from __future__ import annotations

import hashlib
import os
import re
import sys
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.wording import did_you_mean, shown, without_breaks

_REFERENCE = re.compile(r"(?P<file>.+\.py):(?P<name>[^\W\d]\w*)", re.DOTALL)


def is_reference(text: object) -> bool:
    """Whether a text has the form ``FILE.py:NAME``."""
    return isinstance(text, str) and _REFERENCE.fullmatch(text) is not None


def file_of(reference: str) -> str:
    """File of a reference."""
    return reference.rpartition(":")[0]


def load_named(reference: str, what: str) -> Any:
    """Object that a reference names; its file is run once for what it holds.

    Parameters
    ----------
    reference : str
        ``FILE.py:NAME``; ``~`` is the user's home.
    what : str
        What it is for, to begin a complaint with.

    Raises
    ------
    InputError
        The reference is none, its file cannot be read or run, or holds no such name.
    """
    match = _REFERENCE.fullmatch(reference)
    if match is None:
        raise InputError(f"{what}: expected FILE.py:NAME, received {shown(reference)}")
    path, name = Path(os.path.expanduser(match["file"])), match["name"]
    try:
        source = path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a zero in the path
        raise InputError(f"{what} {reference}: expected a readable Python file, {error}") from None
    module = _module(path.resolve(), source, f"{what} {reference}")
    if name not in vars(module):
        own = [each for each in vars(module) if not each.startswith("_")]
        raise InputError(
            f"{what} {reference}: expected a name that the file defines, received {name}"
            f"{did_you_mean(name, own)}"
        )
    return vars(module)[name]


@lru_cache(maxsize=32)
def _module(path: Path, source: bytes, complaint: str) -> ModuleType:
    """Module of a file, run once as long as its content stays the same: an edit is seen by the next load."""
    digest = hashlib.sha256(source).hexdigest()[:12]
    module = ModuleType(f"{path.stem}_{digest}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # where classes and compiled functions look for their globals
    try:
        exec(compile(source, str(path), "exec"), module.__dict__)
    except Exception as error:  # whatever a user's file may raise
        del sys.modules[module.__name__]
        told = without_breaks(error) or type(error).__name__
        raise InputError(f"{complaint}: expected a file that runs, {type(error).__name__}: {told}") from None
    return module
