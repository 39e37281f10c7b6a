"""Preparation of a command: files are read, and laws built and compiled, in a thread of its own.

The thread serves no page and runs no tick. If it does not end in time, the command is refused and the thread
is left alone: a result that comes later is closed.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, wait
from typing import Any

from spheretwin.models.base.errors import InputError, exception_text

LIMIT_s = 300.0
"""Longest preparation of a command: a loop may have to be compiled, a minute on a processor of its own."""

END_s = 2.0
"""Time that the end of the bench waits for a preparation."""


class Preparation:
    """Work that prepares one command.

    Parameters
    ----------
    name : str
        Name of the command.
    work : callable
        Returns what the command needs.
    limit_s : float, s
    """

    def __init__(self, name: str, work: Callable[[], Any], limit_s: float | None = None) -> None:
        self._name, self._limit_s = name, LIMIT_s if limit_s is None else limit_s
        self._due_s = time.monotonic() + self._limit_s
        self._future: Future[Any] = Future()
        self._thread = threading.Thread(target=self._run, args=(work,), name=f"prepare {name}", daemon=True)
        self._thread.start()

    @property
    def done(self) -> bool:
        """True if it has ended, or is too late."""
        return self._future.done() or time.monotonic() >= self._due_s

    def result(self) -> Any:
        """Wait for the result, at most until the limit.

        Raises
        ------
        InputError
            It is too late.
        """
        wait([self._future], max(0.0, self._due_s - time.monotonic()))
        if self._future.done():
            return self._future.result()
        self._future.add_done_callback(_close)
        raise InputError(
            f"bench: expected {self._name} to be prepared within {self._limit_s:g} s, received nothing"
        )

    def abandon(self) -> None:
        """Wait for its end for a moment; close a result that comes later."""
        wait([self._future], END_s)
        self._future.add_done_callback(_close)

    def _run(self, work: Callable[[], Any]) -> None:
        try:
            self._future.set_result(work())
        except Exception as error:  # of any kind: the command that waits for the result raises it
            self._future.set_exception(error)
        except BaseException as error:  # code of the user may raise what would end the loop's thread
            reason = f"bench: expected {self._name} to be prepared, received {exception_text(error)}"
            self._future.set_exception(InputError(reason))


def _close(future: Future[Any]) -> None:
    """Close files that no command will use."""
    close = None if future.exception() else getattr(future.result(), "close", None)
    if close:
        close()
