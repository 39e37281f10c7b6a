"""The one `compiled` decorator: numba with a cache that cannot go stale."""

from collections.abc import Callable
from typing import Any

import numba
from numba.extending import register_jitable

from spheretwin.models.cache import cache_folder

_OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}}


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function at its first call and keep the machine code between processes.

    The uncompiled function stays reachable as ``.py_func``. The interpreter lock is released while
    compiled code runs; division by zero gives inf or NaN, as in NumPy; a product and a sum may be fused
    into one instruction, which rounds once instead of twice.
    """
    dispatcher = numba.njit(nogil=True, **_OPTIONS)(function)
    with _cache_folder_in_use():
        dispatcher.enable_caching()
    return dispatcher


def compiled_callback(signature: Any, function: Callable[..., Any]) -> Any:
    """Compile a function behind a fixed signature, so that callers need no compilation of their own.

    Parameters
    ----------
    signature : numba signature
        Argument and return types.
    function : callable
        A plain function, or one that numba has already wrapped.
    """
    python_function = getattr(function, "py_func", function)
    # Only these sources are watched by the cache; another's would go stale.
    cached = python_function.__module__.startswith("spheretwin.")
    with _cache_folder_in_use():
        return numba.cfunc(signature, nopython=True, cache=cached, **_OPTIONS)(python_function)


class _cache_folder_in_use:
    """Numba reads its cache folder from a global at the moment a function is decorated."""

    def __enter__(self) -> None:
        self.previous = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = str(cache_folder())

    def __exit__(self, *_: object) -> None:
        numba.config.CACHE_DIR = self.previous


def uncompiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """The plain Python function behind a compiled one, or the function itself."""
    return getattr(function, "py_func", function)


def compilable(function: Callable[..., Any]) -> Any:
    """Leave a function to Python, and let compiled code that calls it compile it, as `compiled` does.

    For what calls functions of its users: in the uncompiled loop these are plain Python.
    """
    return register_jitable(**_OPTIONS)(function)
