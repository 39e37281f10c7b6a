"""Functions handed to compiled code by address, so that their caller is compiled once for all of them.

Numba's own way, a function as an argument, asks Python for the address at every call: 8 µs each, three
physics steps for a law and an allocation.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload


def function_at(signature: Any) -> Callable[[Any], Callable[..., Any]]:
    """Make the way from an address back to a function of one signature.

    Parameters
    ----------
    signature : numba signature
        Of every function whose address will be handed over.

    Returns
    -------
    callable
        In compiled code it takes the address of a C callback and returns a function; in Python it returns
        the function that it is given.
    """
    function_type = types.FunctionType(signature)

    @intrinsic
    def from_address(typing_context: Any, address: Any) -> Any:
        if not isinstance(address, types.Integer):
            return None

        def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
            function = cgutils.create_struct_proxy(function_type)(context, builder)
            function.c_addr = builder.inttoptr(arguments[0], cgutils.voidptr_t)
            function.py_addr = function.jit_addr = ir.Constant(cgutils.voidptr_t, None)
            return function._getvalue()

        return function_type(types.intp), build

    def at(function: Any) -> Callable[..., Any]:
        return function

    @overload(at)
    def _compiled_at(function: Any) -> Callable[[Any], Any] | None:
        if not isinstance(function, types.Integer):
            return None

        def call(function: Any) -> Any:
            return from_address(function)

        return call

    return at
