"""Identity of a function to compile: what its machine code depends on, the same in each process.

A function of this package is identified by its place and by what it encloses: the cache tracks the sources of
the package. Any other function, such as a law in a user's file, is identified by its bytecode and by the
values that it names. A value whose content is unknown, such as a module of the user's or an object, leaves
the function without an identity, and it is compiled in each process.
"""

from __future__ import annotations

import hashlib
import re
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

_LIBRARIES = {"builtins", "cmath", "math", "numba", "numpy", "spheretwin"}
"""Packages whose versions or sources are in the name of the cache folder, and those of Python itself."""


class _UnknownError(Exception):
    """A value has no identity."""


def is_of_package(function: Any) -> bool:
    """True if a function is one of this package."""
    return (function.__module__ or "").startswith("spheretwin.")


def name_of(function: Any) -> str:
    """Return the name of a function with that of its module."""
    return f"{function.__module__}.{function.__qualname__}"


def entry_name(function: Any, *others: object) -> str | None:
    """Return the name of a cache entry: the function, then a digest of its identity and of other texts.

    None for a function without an identity: its entry would become stale.
    """
    if (identity := function_identity(function)) is None:
        return None
    key = repr((name_of(function), identity, *map(str, others)))
    readable = re.sub(r"\W+", "-", name_of(function).removeprefix("spheretwin."))[:60]
    return f"{readable}-{hashlib.sha256(key.encode()).hexdigest()[:24]}"


def function_identity(function: Any) -> list[Any] | None:
    """Return the identity of a plain function, nested lists of texts and numbers; None if it has none."""
    try:
        return _function(function, [])
    except _UnknownError:
        return None


def _function(function: Any, outer: list[Any]) -> list[Any]:
    """Return the identity of a function that the `outer` functions name; functions may name each other."""
    if function in outer:
        return [outer.index(function)]
    code, callers = function.__code__, [*outer, function]
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    if is_of_package(function):
        place = [function.__module__, function.__qualname__, code.co_firstlineno]
        return [place, [_value(value, callers) for value in cells]]
    values = [
        function.__globals__[name] for name in sorted(_names(code)) if name in function.__globals__
    ]  # any other name is an attribute, or one of Python's own functions
    return [_code(code), [_value(value, callers) for value in (function.__defaults__, *cells, *values)]]


def _names(code: CodeType) -> set[str]:
    """Return the names in the code of a function and of the functions inside it."""
    inner = (value for value in code.co_consts if isinstance(value, CodeType))
    return set(code.co_names).union(*map(_names, inner))


def _code(code: CodeType) -> list[Any]:
    """Return the identity of bytecode, with its lines, which the messages of exceptions have."""
    constants = [
        _code(value) if isinstance(value, CodeType)
        else sorted(map(repr, value)) if isinstance(value, frozenset)  # its order differs between processes
        else repr(value)
        for value in code.co_consts
    ]  # fmt: skip
    names = [code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars]
    place = [code.co_filename, code.co_firstlineno, code.co_linetable]
    return [code.co_code, code.co_flags, code.co_argcount, constants, names, place]


def _value(value: Any, callers: list[Any]) -> Any:
    """Return the identity of a value that a function names or encloses."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "biufc":
        return [value.dtype.str, value.shape, value.strides, value.tobytes()]
    if value is None or isinstance(value, bool | int | float | complex | str | bytes | np.number | np.bool_):
        return [type(value).__name__, repr(value)]
    if type(value) is tuple:
        return [_value(entry, callers) for entry in value]
    if isinstance(plain := getattr(value, "py_func", None), FunctionType):
        return [repr(value.targetoptions), _function(plain, callers)]
    name = getattr(value, "__name__", "")
    if isinstance(value, ModuleType | type | BuiltinFunctionType | np.ufunc | type(np.sum)):
        owner = name if isinstance(value, ModuleType) else getattr(value, "__module__", None) or "numpy"
        if owner.split(".")[0] in _LIBRARIES:
            return [type(value).__name__, owner, name]
    raise _UnknownError
