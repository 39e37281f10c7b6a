"""The one `compiled` decorator: numba with a cache that cannot go stale.

Numba keys a cached function by its own file alone, so an edited callee in another file would go on
returning its old answer. Here the cache folder is named by a digest of every source file that can
hold compiled code, and of the versions of numba and MuJoCo.
"""

import hashlib
import importlib.metadata
import importlib.util
import os
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numba

_OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}}

COMPILED_PACKAGES = ("spheretwin.models", "spheretwin.control", "spheretwin.twin")


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function at its first call and keep the machine code between processes.

    The uncompiled function stays reachable as ``.py_func``. The interpreter lock is released while
    compiled code runs; division by zero gives inf or NaN, as in NumPy; a product and a sum may be fused
    into one instruction, which rounds once instead of twice.
    """
    dispatcher = numba.njit(nogil=True, **_OPTIONS)(function)
    with _cache_folder_in_use():
        dispatcher.enable_caching()
    return dispatcher


def compiled_callback(signature: Any, function: Callable[..., Any]) -> Any:
    """Compile a function behind a fixed signature, so that callers need no compilation of their own.

    Parameters
    ----------
    signature : numba signature
        Argument and return types.
    function : callable
        A plain function, or one that numba has already wrapped.
    """
    python_function = getattr(function, "py_func", function)
    cached = _source_is_in_a_file(python_function)
    with _cache_folder_in_use():
        return numba.cfunc(signature, nopython=True, cache=cached, **_OPTIONS)(python_function)


def cache_folder() -> Path:
    """Folder of the machine code for these sources; `SPHERETWIN_CACHE_DIR` moves it elsewhere."""
    return _cache_root() / _digest()


class _cache_folder_in_use:
    """Numba reads its cache folder from a global at the moment a function is decorated."""

    def __enter__(self) -> None:
        self.previous = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = str(cache_folder())

    def __exit__(self, *_: object) -> None:
        numba.config.CACHE_DIR = self.previous


def _source_is_in_a_file(function: Callable[..., Any]) -> bool:
    code = getattr(function, "__code__", None)
    return code is not None and Path(code.co_filename).is_file()


@cache
def _cache_root() -> Path:
    chosen = os.environ.get("SPHERETWIN_CACHE_DIR")
    if chosen:
        return Path(chosen)
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "spheretwin"
    try:
        home.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=home):
            return home
    except OSError:  # a read-only home: compile for this process, in a folder of its own
        return Path(tempfile.mkdtemp(prefix="spheretwin-"))


@cache
def _digest() -> str:
    digest = hashlib.sha256()
    for package in ("numba", "mujoco"):
        digest.update(importlib.metadata.version(package).encode())
    for source in _sources():
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _sources() -> Iterator[Path]:
    for package in COMPILED_PACKAGES:
        found = importlib.util.find_spec(package)
        for folder in (found.submodule_search_locations or ()) if found else ():
            yield from sorted(Path(folder).rglob("*.py"))
