"""The one `compiled` decorator: numba with a cache that cannot go stale."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numba.core.ccallback import CFunc
from numba.core.dispatcher import Dispatcher
from numba.extending import register_jitable

from spheretwin.models.base.machine_code import MachineCode

COMPILES = not numba.config.DISABLE_JIT
"""Whether functions are compiled; ``NUMBA_DISABLE_JIT=1`` runs them as they are written, to debug them."""

_OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}}

# Where a plain function has its compiled callbacks: they hold it, and must not outlive it.
_CALLBACKS = "__spheretwin_callbacks__"


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function at its first call and keep the machine code between processes.

    The uncompiled function stays reachable with `uncompiled`. The interpreter lock is released while
    compiled code runs; division by zero gives inf or NaN, as in NumPy; a product and a sum may be fused
    into one instruction, which rounds once instead of twice.
    """
    return _compiled(function)


def allocation_free(function: Callable[..., Any]) -> Any:
    """Compile a function, as `compiled` does, that makes no array: it fills those that it is handed.

    Nothing in it then needs its references counted, which would be a third of the loop's own time: each
    array in a tuple is counted up and down, with a locked instruction, wherever the tuple is handed on.
    """
    return _compiled(function, _nrt=False)


def rounding_each(function: Callable[..., Any]) -> Any:
    """Compile a function, as `allocation_free` does, with each product and each sum rounded by itself.

    For what has to be the same to the last bit as what NumPy makes of the same numbers.
    """
    return _compiled(function, _nrt=False, fastmath=False)


def part_of_its_caller(function: Callable[..., Any]) -> Any:
    """Compile a function, as `allocation_free` does, into each compiled function that calls it.

    For what is called once a tick or a step with tuples of many arrays: handed over, each array is seven
    numbers, a quarter of the loop's own time.
    """
    return _compiled(function, _nrt=False, inline="always")


def for_types_of(function: Any, *arguments: Any) -> Callable[..., Any]:
    """The machine code of a compiled function for arguments of given types, to be called with such alone.

    Numba looks at the type of every argument at every call, 8 µs for the many arrays of a loop. What is
    returned does not look: with other types it would read memory that is not there.
    """
    if not isinstance(function, Dispatcher):
        return uncompiled(function)
    key = function, *map(_kind_of, arguments)
    if key not in _ENTRIES:
        _ENTRIES[key] = function.compile(tuple(map(numba.typeof, arguments)))
    return _ENTRIES[key]


# Numba's own look at a hundred arrays in nested tuples takes half of what a session takes until it is ready.
_ENTRIES: dict[tuple[Any, ...], Callable[..., Any]] = {}


# C-contiguous, Fortran-contiguous, aligned, writeable: of NumPy's flags those that a type depends on.
_TYPE_FLAGS = 0x0001 | 0x0002 | 0x0100 | 0x0400


def _kind_of(value: Any) -> Any:
    """All that numba's type of a value depends on."""
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim, value.flags.num & _TYPE_FLAGS
    if isinstance(value, tuple):
        return type(value), *map(_kind_of, value)
    return type(value)


def uncompiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the plain function that numba has wrapped, or the function itself."""
    plain: Callable[..., Any] = getattr(function, "py_func", function)
    return plain


def compiled_callback(signature: Any, function: Callable[..., Any]) -> Any:
    """Compile a function behind a fixed signature, so that callers need no compilation of their own.

    It is compiled once for a function and a signature, with the values that global variables have then,
    and kept as long as the function.

    Parameters
    ----------
    signature : numba signature
        Argument and return types.
    function : callable
        A plain function, or one that numba has already wrapped.
    """
    plain = uncompiled(function)
    if not COMPILES:
        return plain
    callbacks = plain.__dict__.setdefault(_CALLBACKS, {})
    if signature not in callbacks:
        callbacks[signature] = _callback(signature, plain)
    return callbacks[signature]


def _callback(signature: Any, function: Callable[..., Any]) -> Any:
    callback: Any = CFunc(
        function, (signature.args, signature.return_type), {}, {"nopython": True, **_OPTIONS}
    )
    # Only these sources are watched by the cache; another's would go stale.
    if function.__module__.startswith("spheretwin."):
        callback._cache = MachineCode(function, "callback")
    callback.compile()
    return callback


def compilable(function: Callable[..., Any]) -> Any:
    """Leave a function to Python, and make it part of the compiled code that calls it.

    For what calls functions of its users: in the uncompiled loop these are plain Python.
    """
    return register_jitable(_nrt=False, inline="always", **_OPTIONS)(function)


def _compiled(function: Callable[..., Any], **more: Any) -> Any:
    if not COMPILES:
        return function
    dispatcher = numba.njit(nogil=True, **{**_OPTIONS, **more})(function)
    dispatcher._cache = MachineCode(function, "function")  # as its `enable_caching` does with numba's own
    return dispatcher
