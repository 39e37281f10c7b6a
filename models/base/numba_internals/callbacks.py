"""Compiled callbacks, with bounds checks.

`CFunc` and `Dispatcher` are private. Reason: numba checks bounds only in the outermost function.
"""

from __future__ import annotations

from collections.abc import Callable
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
