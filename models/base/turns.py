"""Turns of threads that run Python: one thread at a time, except in its compiled loop.

The interpreter lock alone is released in every short call of compiled code and in every operation of NumPy on
more than 500 numbers. Another thread then takes it for all of its own set-up, and the threads fall into step:
all of them set up at the same time, then all compute.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

_TURN = threading.Lock()
_THREAD = threading.local()


@contextmanager
def turn() -> Iterator[None]:
    """Wait until no other thread has the turn, and have it until the end of the block."""
    with _TURN:
        _THREAD.has_turn = True
        try:
            yield
        finally:
            _THREAD.has_turn = False


class _Outside:
    """Context in which other threads may have the turn of this thread; without a turn it does nothing."""

    def __enter__(self) -> None:
        had_turn = getattr(_THREAD, "has_turn", False)
        _THREAD.outer_turns = [*getattr(_THREAD, "outer_turns", ()), had_turn]
        if had_turn:
            _THREAD.has_turn = False
            _TURN.release()

    def __exit__(self, *_: object) -> None:
        if _THREAD.outer_turns.pop():
            _TURN.acquire()
            _THREAD.has_turn = True


outside_turn = _Outside()
"""Context for compiled loops and for user code, which may take long."""
