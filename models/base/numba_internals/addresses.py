"""Functions and values by address: C functions for compiled code, compiled functions for C code.

*Functions by address* (`cgutils`, `FunctionType`). Reason: the loop is compiled once for all laws.
Consequence of a change: the loop does not compile.

*Values in memory* (`get_data_type`, `get_abi_sizeof`). Reason: C code passes an address to compiled code,
which reads a tuple of arrays there. Consequence: a plugin reads invalid memory.

`tests/models/base/test_internals.py` checks both.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import llvmlite.binding
import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.core.registry import cpu_target
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

from spheretwin.models.base.numba_internals.functions import NO_ALLOCATION, compiled_function


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


def _build_store(typing_context: Any, address: Any, value: Any) -> Any:
    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        pointer = builder.inttoptr(arguments[0], context.get_data_type(value).as_pointer())
        builder.store(context.data_model_manager[value].as_data(builder, arguments[1]), pointer)
        return context.get_dummy_value()

    return types.void(types.intp, value), build


_store: Any = intrinsic(_build_store)


def _write(address: int, value: Any) -> None:
    _store(address, value)


_compiled_write: Any = compiled_function(_write, **NO_ALLOCATION)


def in_memory(value: Any) -> NDArray[np.uint8]:
    """Return a copy of a tuple of arrays and numbers as compiled code has it in memory.

    Compiled code with the address of the copy as an argument of the type ``CPointer(typeof(value))`` reads
    the tuple as entry 0. The arrays are shared: they must exist as long as the copy is read.
    """
    context = cpu_target.target_context
    copy = np.zeros(context.get_abi_sizeof(context.get_data_type(typeof(value))), np.uint8)
    _compiled_write(copy.ctypes.data, value)
    return copy
