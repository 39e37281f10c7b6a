"""Cache folder for results that are expensive to compute and can always be computed again.

The name of the folder is a digest of every source file that can hold compiled code, and of the versions of
the packages involved, so that no entry can be stale. Numba itself keys a cached function by its own file
alone: an edited callee in another file would still give the old result.

Each entry begins with a digest of its content: a truncated or damaged entry is computed again. Without a
writable folder nothing is cached.
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

WITHOUT_COMPILED_CODE = ("analysis", "bench", "cli", "machine", "study", "viz")
"""Folders of the package whose sources no compiled function depends on."""


def cache_folder() -> Path | None:
    """Return the folder for these sources and versions; None if there is no writable one.

    `SPHERETWIN_CACHE_DIR` moves it elsewhere.
    """
    root = _root()
    return root and root / sources_digest()


def load_entry(name: str) -> bytes | None:
    """Return the content of an entry; None if there is none, or if it is damaged."""
    folder = cache_folder()
    if folder is None:
        return None
    try:
        entry = (folder / name).read_bytes()
    except OSError:
        return None
    digest, content = entry[:_DIGEST_BYTES], entry[_DIGEST_BYTES:]
    return content if digest == hashlib.sha256(content).digest() else None


def store_entry(name: str, content: bytes) -> None:
    """Store the content of an entry; a folder that cannot be written is ignored."""
    if folder := cache_folder():
        with suppress(OSError, SpheretwinError):
            folder.mkdir(parents=True, exist_ok=True)
            with whole_file(folder / name) as temporary:
                temporary.write_bytes(hashlib.sha256(content).digest() + content)


def cached_array(key: bytes, compute: Callable[[], NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return an array from the cache, or compute it and store it there.

    Parameters
    ----------
    key : bytes
        Everything that the array depends on, except the sources.
    compute : callable
        Computes the array.
    """
    name = f"{hashlib.sha256(key).hexdigest()[:32]}.npy"
    if content := load_entry(name):
        with suppress(ValueError, EOFError):  # complete, but not an array
            return np.load(io.BytesIO(content))
    array, buffer = compute(), io.BytesIO()
    np.save(buffer, array)
    store_entry(name, buffer.getvalue())
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
    if folder := os.environ.get("SPHERETWIN_CACHE_DIR"):
        yield Path(folder)
    if folder := os.environ.get("XDG_CACHE_HOME"):
        yield Path(folder) / "spheretwin"
    with suppress(RuntimeError):  # a user without a home
        yield Path.home() / ".cache" / "spheretwin"


@cache
def sources_digest() -> str:
    """Return a digest of all sources with compiled code, and of the versions of the packages involved."""
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
