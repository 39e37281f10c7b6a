"""Compiled callbacks: with bounds checks, and with exceptions that reach Python.

`CFunc`, `Dispatcher` and the text of `sys.unraisablehook` are private. Reason: numba checks bounds only in
the outermost function, and drops the exceptions of callbacks. Consequence of a change: an exception of a law
is printed, and the run ends as diverged. `tests/models/base/test_internals.py` checks it.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import CellType, FunctionType
from typing import Any

from numba.core.ccallback import CFunc
from numba.core.compiler import Compiler, CompilerBase

from spheretwin.models.base.numba_internals.functions import Dispatcher
from spheretwin.models.base.numba_internals.machine_code import MachineCode


def c_callback(
    signature: Any,
    function: Callable[..., Any],
    options: dict[str, Any],
    check_bounds: bool,
    pipeline_class: type[CompilerBase] = Compiler,
) -> Any:
    """Compile a plain function as a C callback, whose field `address` is its address."""
    step = _with_bounds_checks(function, {}) if check_bounds else function
    options = {**options, "boundscheck": check_bounds}
    callback: Any = CFunc(step, (signature.args, signature.return_type), {}, options, pipeline_class)
    if not check_bounds:
        callback._cache = MachineCode(function, "callback")
    callback.compile()
    return callback


def _with_bounds_checks(function: Any, copies: dict[int, Any]) -> FunctionType:
    """Copy a plain function so that the compiled functions that it calls by name check bounds.

    Numba checks bounds in the function that it compiles, but not in functions that this function calls.

    Parameters
    ----------
    function : function
    copies : dict
        Copies of compiled functions made so far, by the identity of the original.
    """
    copy = _copied(function)
    _name_copies(function, copy, copies)
    return copy


def _dispatcher_with_bounds_checks(value: Any, copies: dict[int, Any]) -> Any:
    """Copy a compiled function so that it checks bounds; return any other value unchanged."""
    if not isinstance(value, Dispatcher):
        return value
    if id(value) not in copies:
        copy = _copied(value.py_func)
        own: Any = value
        options = {**own.targetoptions, "boundscheck": True}
        copies[id(value)] = type(own)(copy, own.locals, options, own._compiler.pipeline_class)
        _name_copies(value.py_func, copy, copies)  # last: functions may call each other
    return copies[id(value)]


def _copied(function: Any) -> FunctionType:
    """Copy a function, with its own global variables and with empty cells."""
    cells = tuple(CellType() for _ in function.__closure__ or ())
    copy = FunctionType(
        function.__code__, dict(function.__globals__), function.__name__, function.__defaults__, cells
    )
    copy.__module__, copy.__qualname__ = function.__module__, function.__qualname__
    return copy


def _name_copies(function: Any, copy: FunctionType, copies: dict[int, Any]) -> None:
    """Let the copy of a function name the copies of the compiled functions that the original names."""
    for name in set(function.__code__.co_names) & function.__globals__.keys():
        copy.__globals__[name] = _dispatcher_with_bounds_checks(function.__globals__[name], copies)
    for original, cell in zip(function.__closure__ or (), copy.__closure__ or (), strict=True):
        cell.cell_contents = _dispatcher_with_bounds_checks(original.cell_contents, copies)


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

    A callback cannot raise into the compiled code that calls it. Numba hands its exception to
    `sys.unraisablehook`, which prints it, and the caller goes on.

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
