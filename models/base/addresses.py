"""Functions by address: compiled code calls a function that it was not compiled with.

Laws, allocations, estimators and the stages of the loop are compiled alone. Their caller gets their
addresses, and is compiled once for all of them. A GPU has no addresses of this process: there the caller
gets the functions themselves, and is compiled with them.
"""

from __future__ import annotations

from collections.abc import Callable
from inspect import Parameter, Signature
from typing import Any

import llvmlite.binding
from llvmlite import ir
from numba import types
from numba.core.cpu import CPUContext
from numba.extending import lower_builtin, type_callable


def external_function(name: str, address: int, signature: Any) -> Any:
    """Return a C function for compiled code.

    LLVM resolves its symbol by name, so that code that calls it can be cached.
    """
    llvmlite.binding.add_symbol(name, address)
    return types.ExternalFunction(name, signature)


def caller_of(signature: Any) -> Callable[..., Any]:
    """Return the function ``call(function, *arguments)`` for all functions of one signature.

    In compiled code `function` is the address of a C callback of `numba.cfunc`, or a compiled function, of
    which only the number of arguments has to fit; in Python it is callable.

    Parameters
    ----------
    signature : numba signature
        Of every function that is called.
    """

    def call(function: Any, *arguments: Any) -> Any:
        return function(*arguments)

    def typer(*kinds: Any) -> Any:
        if isinstance(kinds[0], types.Callable):
            return signature.return_type(*kinds)
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
        if not isinstance(context, CPUContext):  # no function is there, and none is called
            return ir.Constant(kind.return_type, ir.Undefined)
        return builder.call(builder.inttoptr(given[0], kind.as_pointer()), given[1:])

    lower_builtin(call, types.intp, *signature.args)(build)
    lower_builtin(call, types.Callable, types.VarArg(types.Any))(_build_direct)
    return call


def _build_direct(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    function, *kinds = signature.args
    chosen = function.get_call_type(context.typing_context, tuple(kinds), {})
    asked = zip(given[1:], kinds, chosen.args, strict=True)
    return context.get_function(function, chosen)(builder, [context.cast(builder, *own) for own in asked])
