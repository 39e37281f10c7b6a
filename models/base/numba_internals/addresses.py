"""Functions and values by address: C functions for compiled code, compiled functions for C code.

*Functions by address* (`cgutils`, `FunctionType`). Reason: the loop is compiled once for all laws.
Consequence of a change: the loop does not compile.

*Values in memory* (the layout of arrays and tuples). Reason: stages of the loop, and the plugin, are
compiled alone and get the address of their data. Consequence: they read invalid memory.

`tests/models/base/test_internals.py` checks both.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import llvmlite.binding
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload
from numpy.typing import NDArray


def external_function(name: str, address: int, signature: Any) -> Any:
    """Return a C function for compiled code.

    LLVM resolves its symbol by name, so that code that calls it can be cached.
    """
    llvmlite.binding.add_symbol(name, address)
    return types.ExternalFunction(name, signature)


def function_at(signature: Any) -> Callable[[Any], Callable[..., Any]]:
    """Return a converter from an address to a function of one signature.

    Parameters
    ----------
    signature : numba signature
        Signature of every function that is passed by address.

    Returns
    -------
    callable
        In compiled code it takes the address of a C callback and returns a function; in Python it returns
        its argument.
    """
    function_type = types.FunctionType(signature)

    def build_from_address(typing_context: Any, address: Any) -> Any:
        if not isinstance(address, types.Integer):
            return None

        def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
            function = cgutils.create_struct_proxy(function_type)(context, builder)
            function.c_addr = builder.inttoptr(arguments[0], cgutils.voidptr_t)
            function.py_addr = function.jit_addr = ir.Constant(cgutils.voidptr_t, None)
            return function._getvalue()

        return function_type(types.intp), build

    from_address: Any = intrinsic(build_from_address)

    def at(function: Any) -> Callable[..., Any]:
        return function

    def compiled_at(function: Any) -> Callable[[Any], Any] | None:
        if not isinstance(function, types.Integer):
            return None

        def call(function: Any) -> Any:
            return from_address(function)

        return call

    overload(at)(compiled_at)
    return at


def in_memory(value: Any) -> NDArray[np.uint8]:
    """Return a copy of a tuple of arrays and numbers as compiled code has it in memory.

    Compiled code with the address of the copy as an argument of the type ``CPointer(typeof(value))`` reads
    the tuple as entry 0. The arrays are shared: they must exist as long as the copy is read. Numba's own
    conversion of a tuple of a hundred arrays would take seconds to compile, for each type.
    """
    memory = bytearray()
    _append(memory, value)
    return np.frombuffer(memory, np.uint8)


def _append(memory: bytearray, value: Any) -> None:
    """Append a value at the next address that has its alignment."""
    if isinstance(value, tuple):
        aligned = _is_aligned(value)
        if aligned:
            _pad(memory)
        for part in value:
            _append(memory, part)
        if aligned:
            _pad(memory)
    elif isinstance(value, bool | np.bool_):
        memory.append(bool(value))
    else:
        _pad(memory)
        memory += _words(value)


def _words(value: Any) -> bytes:
    """Return what compiled code has of an array, a number or None, in words of eight bytes."""
    if isinstance(value, np.ndarray):  # without the two objects that count its references
        place = 0, 0, value.size, value.itemsize, value.ctypes.data, *value.shape, *value.strides
        return struct.pack(f"={len(place)}q", *place)
    if isinstance(value, float):
        return struct.pack("=d", value)
    if isinstance(value, int | np.int64 | None):
        return struct.pack("=q", value or 0)
    raise TypeError(f"expected a tuple of arrays and numbers of eight bytes, received {value!r}")


def _is_aligned(value: Any) -> bool:
    """True for all but logical values and tuples of nothing else."""
    return (
        any(map(_is_aligned, value)) if isinstance(value, tuple) else not isinstance(value, bool | np.bool_)
    )


def _pad(memory: bytearray) -> None:
    memory += bytes(-len(memory) % 8)
