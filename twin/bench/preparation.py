"""Preparation of a command: files are read, and laws built and compiled, in a thread of its own.

The thread serves no page and runs no tick. If it does not end in time, the command is refused and the thread
is left alone: a result that comes later is closed.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
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
        self._name, self._work = name, work
        self._limit_s = LIMIT_s if limit_s is None else limit_s
        self._due_s = time.monotonic() + self._limit_s
        self._lock, self._ended = threading.Lock(), threading.Event()
        self._outcome: Any = None
        self._error: Exception | None = None
        self._abandoned = False
        self._thread = threading.Thread(target=self._run, name=f"prepare {name}", daemon=True)
        self._thread.start()

    @property
    def done(self) -> bool:
        """True if it has ended, or is too late."""
        return self._ended.is_set() or time.monotonic() >= self._due_s

    def result(self) -> Any:
        """Wait for the result, at most until the limit.

        Raises
        ------
        InputError
            It is too late.
        """
        self._ended.wait(max(0.0, self._due_s - time.monotonic()))
        with self._lock:
            self._abandoned = not self._ended.is_set()
        if self._abandoned:
            raise InputError(
                f"bench: expected {self._name} to be prepared within {self._limit_s:g} s, received nothing"
            )
        if self._error is not None:
            raise self._error
        return self._outcome

    def abandon(self) -> None:
        """Wait for its end for a moment; close a result that comes later."""
        self._thread.join(END_s)
        with self._lock:
            self._abandoned = True
            if self._ended.is_set():
                _close(self._outcome)

    def _run(self) -> None:
        outcome: Any = None
        error: Exception | None = None
        try:
            outcome = self._work()
        except Exception as raised:
            error = raised
        except BaseException as raised:  # code of the user may raise what would end the loop's thread
            error = InputError(
                f"bench: expected {self._name} to be prepared, received {exception_text(raised)}"
            )
        with self._lock:
            self._outcome, self._error = outcome, error
            self._ended.set()
            if self._abandoned:
                _close(outcome)


def _close(outcome: Any) -> None:
    """Close files that no command will use."""
    if close := getattr(outcome, "close", None):
        close()
