"""Numba internals: cache of compiled functions in the package's cache folder, and functions by address."""

from __future__ import annotations

import hashlib
import pickle
import re
import warnings
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.errors import NumbaWarning
from numba.core.runtime import rtsys
from numba.core.serialize import dumps
from numba.cpython import hashing
from numba.experimental import function_type
from numba.extending import intrinsic, overload

from spheretwin.models.base import cache

# Loaded machine code needs the symbols of hashes and the type of a callback, in addition to the math and
# run-time libraries. These imports register them.
_REGISTERED = hashing, function_type


# mypy sees the base class as Any, because numba has no type information.
class MachineCode(NullCache):  # type: ignore[misc]
    """Cache of the machine code of one function, one entry for each signature.

    Numba's own cache takes its folder from a setting that all packages share, and an entry that is damaged or
    cannot be written is an error at every call. Here the function is compiled again.

    Parameters
    ----------
    function : callable
        A plain function of this package: the cache tracks only its sources.
    kind : str
        Distinguishes different compilations of one function.
    """

    def __init__(self, function: Callable[..., Any], kind: str) -> None:
        self._name = f"{function.__module__}.{function.__qualname__}"
        self._function, self._kind = function, kind

    @property
    def cache_path(self) -> str | None:
        """Folder of the entries."""
        folder = cache.cache_folder()
        return str(folder) if folder else None

    def load_overload(self, sig: Any, target_context: Any) -> CompileResult | None:
        """Return the machine code for a signature; None if there is no usable entry."""
        # Numba's cache would import everything that can be compiled, with scipy.linalg: a third of a short
        # run.
        rtsys.initialize(target_context)
        content = cache.load_entry(self._entry(sig, target_context.codegen()))
        if content is None:
            return None
        try:
            signature, parts = pickle.loads(content)
            if signature != sig:  # a different signature with the same text
                return None
            return CompileResult._rebuild(target_context, *parts)
        # Unpickling or linking a damaged entry may raise anything; the function is compiled again.
        except Exception:
            return None

    def save_overload(self, sig: Any, data: CompileResult) -> None:
        """Store the machine code for a signature."""
        if data.library.has_dynamic_globals:
            complaint = f"{self._name} is compiled in every process: it holds an address or a large array"
            warnings.warn(complaint, NumbaWarning, stacklevel=2)
            return
        cache.store_entry(self._entry(sig, data.codegen), dumps((sig, data._reduce())))

    def _entry(self, sig: Any, codegen: Any) -> str:
        """Return the name of an entry: function, then a digest of function, signature and processor."""
        line = self._function.__code__.co_firstlineno
        closure = dumps([cell.cell_contents for cell in self._function.__closure__ or ()])
        key = repr((self._name, line, closure, self._kind, str(sig), codegen.magic_tuple()))
        readable = re.sub(r"\W+", "-", self._name.removeprefix("spheretwin."))[:60]
        return f"{readable}-{hashlib.sha256(key.encode()).hexdigest()[:24]}"


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
