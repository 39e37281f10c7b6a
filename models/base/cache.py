"""Cache folder for results that are expensive to compute and can always be computed again.

The name of the folder is a digest of every source file that can hold compiled code, and of the versions of
the packages involved, so that no entry can be stale. Numba itself keys a cached function by its own file
alone: an edited callee in another file would still give the old result.

Each entry begins with a digest of its content: a truncated or damaged entry is computed again. Without a
writable folder nothing is cached.

An entry may be a pickle, which runs code when it is read. Folders are therefore created for their owner
alone, and a folder or an entry that another account can change is not used.
"""

import hashlib
import importlib.metadata
import importlib.util
import io
import os
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.errors import HIDDEN, one_line

WITHOUT_COMPILED_CODE = ("analysis", "bench", "cli", "machine", "study", "viz")
"""Folders of the package whose sources no compiled function depends on."""


class CacheFolder(NamedTuple):
    """Folder of the cache."""

    path: Path | None
    """None if there is no usable one."""
    refusal: str = ""
    """Reason for which the folder of the user is not used; empty if there is none."""


def cache_folder() -> Path | None:
    """Return the folder for these sources and versions; None if there is no usable one.

    `SPHERETWIN_CACHE_DIR` moves it elsewhere. The first call of a process reports a refused folder on stderr.
    """
    return checked_folder().path


@cache
def checked_folder() -> CacheFolder:
    """Return the folder for these sources and versions, or the reason for which there is none."""
    for root in _candidates():
        try:
            folder = (root / sources_digest()).resolve()
            if refusal := _made_or_refused(folder):
                refusal = (
                    f"cache: expected a folder that no other account can change, received {root}: {refusal}"
                )
                print(f"spheretwin: {one_line(refusal)}; nothing is cached on disk", file=sys.stderr)
                return CacheFolder(None, refusal)
            with tempfile.TemporaryFile(dir=folder):
                return CacheFolder(folder)
        except (OSError, RuntimeError):  # the latter: a link in a circle, until Python 3.13
            continue
    return CacheFolder(None)


def load_entry(name: str) -> bytes | None:
    """Return the content of an entry; None if there is none, if it is damaged, or if others can change it."""
    folder = cache_folder()
    if folder is None:
        return None
    try:
        with (folder / name).open("rb") as file:
            entry = b"" if _danger(os.fstat(file.fileno())) else file.read()
    except OSError:
        return None
    digest, content = entry[:_DIGEST_BYTES], entry[_DIGEST_BYTES:]
    return content if digest == hashlib.sha256(content).digest() else None


def store_entry(name: str, content: bytes) -> None:
    """Store the content of an entry, for this account alone; a folder that cannot be written is ignored."""
    with suppress(OSError):
        # The folder is made again: someone may have cleared the cache meanwhile.
        if (folder := cache_folder()) and not _made_or_refused(folder):
            descriptor, temporary = tempfile.mkstemp(dir=folder, prefix=f".{name[:100]}.", suffix=HIDDEN)
            try:
                with open(descriptor, "wb") as file:
                    file.write(hashlib.sha256(content).digest() + content)
                os.replace(temporary, folder / name)
            finally:
                Path(temporary).unlink(missing_ok=True)


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


def _made_or_refused(folder: Path) -> str:
    """Create a folder and its parents; return a reason, if another account can change one of them."""
    for path in (*reversed(folder.parents), folder):
        with suppress(FileExistsError):
            if not path.exists():
                path.mkdir(mode=0o700)
        if danger := _danger(path.stat(), may_be_sticky=path != folder):
            return f"{path} {danger}"
    return ""


def _danger(status: os.stat_result, may_be_sticky: bool = False) -> str:
    """Return in which way another account than root can change a file or a folder, as ssh checks its keys.

    Parameters
    ----------
    status : os.stat_result
    may_be_sticky : bool
        Accept a folder of all accounts in which each one can rename its own entries only, such as /tmp.
    """
    if not hasattr(os, "geteuid"):  # Windows, where the rights of a folder are not in its mode
        return ""
    if status.st_uid not in (0, os.geteuid()):
        return f"belongs to another account (number {status.st_uid})"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH) and not (
        may_be_sticky and status.st_mode & stat.S_ISVTX
    ):
        return f"can be written by {'everyone' if status.st_mode & stat.S_IWOTH else 'its group'}"
    return ""


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
