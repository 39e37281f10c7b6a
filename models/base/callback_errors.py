"""Exceptions of compiled callbacks, for Python.

A callback cannot raise into the compiled code that calls it. Numba hands its exception to
`sys.unraisablehook`, which prints it, and the caller goes on.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


class _CallbackErrors(threading.local):
    """Receiver of the exceptions of compiled callbacks, one for each thread."""

    receiver: Callable[[BaseException], None] | None = None


_CALLBACK_ERRORS = _CallbackErrors()
_HOOK_LOCK = threading.Lock()
_HOOKS: list[Callable[[Any], object]] = []
"""Previous hook, once for each running block."""


@contextmanager
def callback_errors(receiver: Callable[[BaseException], None]) -> Iterator[None]:
    """Pass exceptions of compiled callbacks in this thread to a function, while the block runs.

    Parameters
    ----------
    receiver : callable
        Called before the callback returns to its caller.
    """
    with _HOOK_LOCK:
        _HOOKS.append(_HOOKS[0] if _HOOKS else sys.unraisablehook)
        sys.unraisablehook = _receive
    outer, _CALLBACK_ERRORS.receiver = _CALLBACK_ERRORS.receiver, receiver
    try:
        yield
    finally:
        _CALLBACK_ERRORS.receiver = outer
        with _HOOK_LOCK:
            before = _HOOKS.pop()
            if not _HOOKS:
                sys.unraisablehook = before


def report_error(error: BaseException) -> bool:
    """Pass an exception of plain Python to the receiver of this thread, if there is one."""
    receiver = _CALLBACK_ERRORS.receiver
    if receiver:
        receiver(error)
    return receiver is not None


def _receive(unraisable: Any) -> None:
    """Pass on the exception of a callback; leave every other to the hook that was there before."""
    # Numba names the compiler's context as the place, whatever the callback is.
    is_callback = "CPUContext" in f"{unraisable.object}"
    if _CALLBACK_ERRORS.receiver and is_callback:
        _CALLBACK_ERRORS.receiver(unraisable.exc_value or unraisable.exc_type())
    else:
        (_HOOKS[0] if _HOOKS else sys.__unraisablehook__)(unraisable)
