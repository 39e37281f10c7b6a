"""A folder for what is expensive to make and can always be made again.

Its name is a digest of every source file that can hold compiled code, and of the versions of what it is
made with, so that nothing in it can be stale: numba itself keys a cached function by its own file alone, and
an edited callee in another file would go on returning its old answer.

Each entry begins with a digest of what follows: one that was cut short or damaged is made again. A folder
that cannot be written is done without.
"""

import hashlib
import importlib.metadata
import importlib.util
import io
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.base.files import whole_file

WITHOUT_COMPILED_CODE = ("analysis", "bench", "cli", "study", "viz")
"""Folders of the package whose sources no compiled function depends on."""


def cache_folder() -> Path | None:
    """Folder for these sources and versions, None where none can be had.

    `SPHERETWIN_CACHE_DIR` moves it elsewhere.
    """
    root = _root()
    return root and root / sources_digest()


def kept(name: str) -> bytes | None:
    """What was kept under a name; None if nothing was, or if it is damaged."""
    folder = cache_folder()
    if folder is None:
        return None
    try:
        entry = (folder / name).read_bytes()
    except OSError:
        return None
    digest, content = entry[:_DIGEST_BYTES], entry[_DIGEST_BYTES:]
    return content if digest == hashlib.sha256(content).digest() else None


def keep(name: str, content: bytes) -> None:
    """Keep something under a name, unless the folder cannot take it: it can always be made again."""
    if folder := cache_folder():
        with suppress(OSError, SpheretwinError):
            folder.mkdir(parents=True, exist_ok=True)
            with whole_file(folder / name) as temporary:
                temporary.write_bytes(hashlib.sha256(content).digest() + content)


def cached_array(key: bytes, compute: Callable[[], NDArray[np.float64]]) -> NDArray[np.float64]:
    """Array from the cache, or computed and then kept there.

    Parameters
    ----------
    key : bytes
        Everything beside the sources that the array depends on.
    compute : callable
        Makes the array.
    """
    name = f"{hashlib.sha256(key).hexdigest()[:32]}.npy"
    if content := kept(name):
        with suppress(ValueError, EOFError):  # whole, but no array
            return np.load(io.BytesIO(content))
    array, made = compute(), io.BytesIO()
    np.save(made, array)
    keep(name, made.getvalue())
    return array


_DIGEST_BYTES = hashlib.sha256().digest_size


@cache
def _root() -> Path | None:
    for folder in _candidates():
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                return folder
        except OSError:
            continue
    return None


def _candidates() -> Iterator[Path]:
    if chosen := os.environ.get("SPHERETWIN_CACHE_DIR"):
        yield Path(chosen)
    if chosen := os.environ.get("XDG_CACHE_HOME"):
        yield Path(chosen) / "spheretwin"
    with suppress(RuntimeError):  # a user without a home
        yield Path.home() / ".cache" / "spheretwin"


@cache
def sources_digest() -> str:
    """Digest of all sources that can hold compiled code, and of the versions of what it is made with."""
    digest = hashlib.sha256((sys.implementation.cache_tag or sys.version).encode())
    for package in ("numba", "llvmlite", "mujoco", "numpy", "scipy"):
        digest.update(importlib.metadata.version(package).encode())
    for source in _sources():
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _sources() -> Iterator[Path]:
    folders = {"spheretwin": WITHOUT_COMPILED_CODE, "spheretwin.models": (), "spheretwin.control": ()}
    for package, excluded in folders.items():
        spec = importlib.util.find_spec(package)
        for folder in map(Path, (spec.submodule_search_locations or ()) if spec else ()):
            yield from sorted(
                p for p in folder.rglob("*.py") if p.relative_to(folder).parts[0] not in excluded
            )
