"""Decorators for compiled functions, with a cache that cannot become stale."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import is_jitted, lower_builtin, type_callable
from numpy.typing import NDArray

from spheretwin.models.base.bounds_checks import with_bounds_checks
from spheretwin.models.base.numba_internals import c_callback, compiled_function
from spheretwin.models.base.record import Rows

F = TypeVar("F", bound=Callable[..., Any])

COMPILES = not numba.config.DISABLE_JIT
"""Whether functions are compiled; ``NUMBA_DISABLE_JIT=1`` runs them as plain Python, for debugging."""

_OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": {"contract"},
    "forceinline": False,  # otherwise a function takes the option of the caller that needs it first
    "no_cfunc_wrapper": True,  # a conversion for functions that are passed as values: ours go by address
}
_ALLOCATION_FREE: dict[str, Any] = {"_nrt": False}

# Attribute of a plain function with its compiled callbacks: they refer to it, and must not outlive it.
_CALLBACKS = "__spheretwin_callbacks__"


def compiled(function: F) -> F:
    """Compile a function at its first call and cache the machine code between processes.

    The uncompiled function stays available with `uncompiled`. The interpreter lock is released while
    compiled code runs; division by zero gives inf or NaN, as in NumPy; a product and a sum may be fused
    into one instruction, which rounds once instead of twice.
    """
    return _compiled(function)


def allocation_free(function: F) -> F:
    """Compile a function, as `compiled` does, that creates no array: it fills its arguments.

    It then needs no reference counting, which takes a third of a tick on the Lagrangian engine and a twelfth
    of one of a prototype. It must not return an array, alone or in a tuple: a caller that counts references
    would release it.
    """
    return _compiled(function, **_ALLOCATION_FREE)


def rounding_each(function: F) -> F:
    """Compile a function, as `allocation_free` does, with each product and each sum rounded separately.

    For results that must equal those of NumPy to the last bit.
    """
    return _compiled(function, **_ALLOCATION_FREE, fastmath=False)


def inlined(function: F) -> F:
    """Compile a function, as `allocation_free` does, always into its caller, after its own optimisation.

    A loop in which a call is left is not vectorised, and a call copies seven numbers for each array: the tick
    of a prototype would take a seventh more.
    """
    return _compiled(function, **_ALLOCATION_FREE, forceinline=True)


def part_of_its_caller(function: F) -> F:
    """Copy a function into its caller before the caller is compiled: it may return a tuple with a record."""
    return _compiled(function, **_ALLOCATION_FREE, inline="always")


def for_types_of(function: Any, *arguments: Any) -> Callable[..., Any]:
    """Return the machine code of a compiled function for the types of the given arguments.

    Numba checks the type of every argument at every call, 8 µs for the many arrays of a loop. The returned
    function does not check: with other types it would read invalid memory.
    """
    if not is_jitted(function):
        return uncompiled(function)
    key = function, _kind(arguments)
    if key not in _ENTRIES:
        _ENTRIES[key] = function.compile(tuple(map(_type_of, arguments)))
    return _ENTRIES[key]


def without_fields(value: Any) -> Any:
    """Return an argument of the machine code of `for_types_of`, with records that share memory and no fields.

    The code reads the address of a record alone. NumPy would describe the fields at each call, in 10 µs for
    the controller.
    """
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return type(value)(*map(without_fields, value))
    if isinstance(value, np.void):
        return value.view([("bytes", f"V{value.dtype.itemsize}")])
    return value


def _type_of(value: Any) -> Any:
    """Return the type of an argument; of arrays of records one for any distance between the records."""
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return types.NamedTuple(tuple(map(_type_of, value)), type(value))
    if isinstance(value, np.ndarray) and value.dtype.names:
        return types.Array(numba.from_dtype(value.dtype), value.ndim, "A")
    return numba.typeof(value)


def _kind(value: Any) -> Any:
    """Return what the type of a value depends on: numba's own type takes longer to find than a short run."""
    if isinstance(value, tuple):
        return type(value), *map(_kind, value)
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim, value.flags.c_contiguous or value.dtype.names is not None
    if isinstance(value, np.void):
        return value.dtype
    return type(value)


_ENTRIES: dict[tuple[Any, ...], Any] = {}


def uncompiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the plain function that numba has wrapped, or the function itself."""
    plain: Callable[..., Any] = getattr(function, "py_func", function)
    return plain


def compiled_callback(signature: Any, function: Callable[..., Any], *, check_bounds: bool = False) -> Any:
    """Compile a function behind a fixed signature, so that callers need no compilation of their own.

    It is compiled once for a function and a signature, with the present values of global variables, and
    stored as long as the function exists.

    Parameters
    ----------
    signature : numba signature
        Argument and return types.
    function : callable
        A plain function, or one that numba has already wrapped.
    check_bounds : bool
        Raise `IndexError` if the function, or a compiled function that it calls by name, reads or writes
        outside an array.
    """
    plain = uncompiled(function)
    if not COMPILES:
        return plain
    callbacks = plain.__dict__.setdefault(_CALLBACKS, {})
    key = signature, check_bounds
    if key not in callbacks:
        callbacks[key] = (
            numba.cfunc(signature, boundscheck=True, **_OPTIONS)(with_bounds_checks(plain))
            if check_bounds
            else c_callback(plain, signature, _OPTIONS)
        )
    return callbacks[key]


def stage_address(signature: Any, function: Callable[..., Any], *parts: Rows) -> int:
    """Compile a function of records, as `allocation_free` does; return its own address.

    Its callers are compiled once for all types of records.

    Parameters
    ----------
    signature : numba signature
        With the addresses of the records as its first arguments.
    function : callable
        Plain function of the records.
    *parts : arrays of records
    """
    key = function, tuple(part.dtype for part in parts)
    if key not in _ENTRIES:
        records = (numba.from_dtype(part.dtype) for part in parts)  # by address
        own = signature.return_type(*records, *signature.args[len(parts) :])
        _ENTRIES[key] = c_callback(function, own, {**_OPTIONS, **_ALLOCATION_FREE})
    return int(_ENTRIES[key].address)


_HEADINGS = re.compile(r"(\w+Error: )?(Failed in \w+ mode pipeline|During: )")
_PLACE = re.compile(r'File "(?P<file>[^"]+)", line (?P<line>\d+)')
_NOISE = re.compile(r", defined at (None|.+ \(\d+\))|\. Raised from None$")
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")


def compile_error(error: Exception, function: Callable[..., Any]) -> str:
    """Return why a function does not compile, in one line with its line number: numba's reason alone."""
    lines = [line.strip() for line in _COLOURS.sub("", str(error)).splitlines()]
    # An unsupported function of NumPy gives its reason further down, as the last of several.
    nested = [place for place, line in enumerate(lines) if line.endswith("raised a specific error:")]
    lines = lines[nested[-1] + 1 :] if nested else lines
    reasons = [line for line in lines if line and not _HEADINGS.match(line)] or [type(error).__name__]
    reason = reasons[0]
    if reason.endswith(":") and len(reasons) > 1:  # as "found for signature:", the signature follows
        reason = f"{reason} {reasons[1].removeprefix('>>> ')}"
    line = _line_of(error, uncompiled(function))
    return f"{_NOISE.sub('', reason).rstrip('.')}{f', in line {line}' if line else ''}"


def _line_of(error: Exception, function: Callable[..., Any]) -> int | None:
    """Return the line of a function's file that an error of the compiler names first, the innermost one."""
    file = Path(function.__code__.co_filename).name
    for place in _PLACE.finditer(_COLOURS.sub("", str(error))):
        if Path(place["file"]).name == file:
            return int(place["line"])
    location = getattr(error, "loc", None)
    return location.line if location and Path(location.filename).name == file else None


def _compiled(function: F, **more: Any) -> F:
    if not COMPILES:
        return function
    return cast(
        "F",
        compiled_function(function, nogil=True, **{**_OPTIONS, **more}),
    )


def high_product(a: np.uint64, b: np.uint64) -> np.uint64:
    """Return the upper 64 bits of the product of two numbers of 64 bits."""
    return np.uint64(int(a) * int(b) >> 64)


def _build_high_product(context: Any, builder: Any, signature: Any, numbers: Any) -> Any:
    wide = ir.IntType(128)
    product = builder.mul(*(builder.zext(number, wide) for number in numbers))
    return builder.trunc(builder.lshr(product, ir.Constant(wide, 64)), ir.IntType(64))


type_callable(high_product)(lambda _: lambda a, b: types.uint64(types.uint64, types.uint64))
lower_builtin(high_product, types.Integer, types.Integer)(_build_high_product)


@allocation_free
def copy_into(target: NDArray[np.float64], first: int, values: NDArray[np.float64], count: int) -> None:
    """Copy leading values into a vector; a slice would be checked for overlap, in twice the time."""
    for i in range(count):
        target[first + i] = values[i]


@allocation_free
def copy_rows(source: NDArray[np.float64], target: NDArray[np.float64]) -> None:
    """Copy a matrix of three columns."""
    for i in range(source.shape[0]):
        for j in range(3):
            target[i, j] = source[i, j]
