"""A folder for what is expensive to make and can always be made again.

Its name is a digest of every source file that can hold compiled code, and of the versions of the
packages it is made with, so that nothing in it can be stale: numba itself keys a cached function by its
own file alone, and an edited callee in another file would go on returning its old answer.
"""

import atexit
import hashlib
import importlib.metadata
import importlib.util
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

COMPILED_PACKAGES = ("spheretwin.models", "spheretwin.control", "spheretwin.twin")


def cache_folder() -> Path:
    """Folder for these sources and versions; `SPHERETWIN_CACHE_DIR` moves it elsewhere."""
    return _root() / _digest()


def kept_array(key: bytes, compute: Callable[[], NDArray[np.float64]]) -> NDArray[np.float64]:
    """Array from the cache, or computed and then kept there.

    Parameters
    ----------
    key : bytes
        Everything beside the sources that the array depends on.
    compute : callable
        Makes the array.
    """
    path = cache_folder() / f"{hashlib.sha256(key).hexdigest()[:32]}.npy"
    try:
        return np.load(path)
    except (OSError, ValueError, EOFError):
        array = compute()
    with suppress(OSError):  # it can always be made again
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            np.save(file, array)
        os.replace(file.name, path)
    return array


@cache
def _root() -> Path:
    for folder in _candidates():
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                return folder
        except OSError:
            continue
    # Nowhere to keep anything: work for this process, in a folder of its own.
    folder = Path(tempfile.mkdtemp(prefix="spheretwin-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def _candidates() -> Iterator[Path]:
    if chosen := os.environ.get("SPHERETWIN_CACHE_DIR"):
        yield Path(chosen)
    if chosen := os.environ.get("XDG_CACHE_HOME"):
        yield Path(chosen) / "spheretwin"
    with suppress(RuntimeError):  # a user without a home
        yield Path.home() / ".cache" / "spheretwin"


@cache
def _digest() -> str:
    digest = hashlib.sha256()
    for package in ("numba", "mujoco", "numpy", "scipy"):
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
