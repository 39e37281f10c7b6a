"""Compilation: reports of functions that are about to be compiled, and a pause of Python's collector."""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_LISTENERS: list[Callable[[str], None]] = []


def report(name: str) -> None:
    """Tell the listeners that a function is about to be compiled: the cache has no entry."""
    for listener in _LISTENERS:
        listener(name)


@contextmanager
def listening(listener: Callable[[str], None]) -> Iterator[None]:
    """Call a function with the name of each function that is compiled, while the block runs."""
    _LISTENERS.append(listener)
    try:
        yield
    finally:
        _LISTENERS.remove(listener)


@contextmanager
def collector_paused() -> Iterator[None]:
    """Pause the collection of garbage in cycles: it takes a seventh of the time in which a loop compiles."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
