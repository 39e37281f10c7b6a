"""Functions by address: compiled code calls a function that it was not compiled with.

Laws, allocations, estimators and the stages of the loop are compiled alone. Their caller gets their
addresses, and is compiled once for all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from inspect import Parameter, Signature
from typing import Any

import llvmlite.binding
from llvmlite import ir
from numba import types
from numba.extending import lower_builtin, type_callable


def external_function(name: str, address: int, signature: Any) -> Any:
    """Return a C function for compiled code.

    LLVM resolves its symbol by name, so that code that calls it can be cached.
    """
    llvmlite.binding.add_symbol(name, address)
    return types.ExternalFunction(name, signature)


def caller_of(signature: Any) -> Callable[..., Any]:
    """Return the function ``call(function, *arguments)`` for all functions of one signature.

    In compiled code `function` is the address of a C callback of `numba.cfunc`; in Python it is callable.

    Parameters
    ----------
    signature : numba signature
        Of every function that is called.
    """

    def call(function: Any, *arguments: Any) -> Any:
        return function(*arguments)

    def typer(*kinds: Any) -> Any:
        return signature.return_type(types.intp, *signature.args)

    names = [f"argument_{place}" for place in range(len(signature.args) + 1)]
    # Numba binds the arguments of a call to the names of the typer, and a name for all would take them as one
    # tuple. `inspect.signature` reads this attribute of any function, which mypy does not know.
    typer.__signature__ = Signature(  # type: ignore[attr-defined]
        [Parameter(name, Parameter.POSITIONAL_OR_KEYWORD) for name in names]
    )
    type_callable(call)(lambda _: typer)

    def build(context: Any, builder: Any, _: Any, given: Any) -> Any:
        kinds = [context.get_value_type(kind) for kind in signature.args]
        kind = ir.FunctionType(context.get_value_type(signature.return_type), kinds)
        return builder.call(builder.inttoptr(given[0], kind.as_pointer()), given[1:])

    lower_builtin(call, types.intp, *signature.args)(build)
    return call
