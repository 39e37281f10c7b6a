"""Copies of compiled functions that check bounds, with all that they call.

Numba checks bounds in the function that it compiles, but not in the functions that this function calls.
"""

from __future__ import annotations

from types import CellType, FunctionType
from typing import Any

import numba
from numba.extending import is_jitted

from spheretwin.models.base.numba_internals import compiled_function


def with_bounds_checks(function: Any) -> FunctionType:
    """Copy a plain function so that the compiled functions that it calls by name check bounds."""
    copy = _copied(function)
    _name_copies(function, copy, {})
    return copy


def _compiled_copy(value: Any, copies: dict[int, Any]) -> Any:
    """Copy a compiled function so that it checks bounds; return any other value unchanged.

    Parameters
    ----------
    value : object
    copies : dict
        Copies of compiled functions made so far, by the identity of the original.
    """
    if not is_jitted(value):
        return value
    if id(value) not in copies:
        copy = _copied(value.py_func)
        options = {**value.targetoptions, "boundscheck": True}
        jit = compiled_function if hasattr(value, "part") else numba.jit  # with the same bits
        copies[id(value)] = jit(copy, locals=value.locals, **options)
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
        copy.__globals__[name] = _compiled_copy(function.__globals__[name], copies)
    for original, cell in zip(function.__closure__ or (), copy.__closure__ or (), strict=True):
        cell.cell_contents = _compiled_copy(original.cell_contents, copies)
