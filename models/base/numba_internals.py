"""Private parts of numba, in this file alone; `tests/models/base/test_internals.py` checks each.

*Parts*: numba optimises each function completely, makes machine code and a conversion of Python arguments of
it, and does the same in each caller that includes it. Without that the first run compiles in 14 s of
processor time instead of 28 s, and steps of many plants take less.

*Machine code in the cache of this package*: with numba's own cache a damaged entry is an exception or the end
of the process, two processes can store the code of one signature under the name of another, and a function
that encloses a compiled one is never found again. It follows one file of sources, and all packages share its
folder.

*Names of records*: numba counts them in each process. Loaded machine code for one record could be linked to
that for another record, and read its fields.
"""

import hashlib
import pickle
import warnings
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from numba import NumbaWarning, jit, types
from numba.core.caching import NullCache
from numba.core.ccallback import CFunc
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, CompileResult, DefaultPassBuilder
from numba.core.registry import CPUDispatcher
from numba.core.runtime import rtsys
from numba.core.serialize import dumps
from numba.cpython import hashing as hashing  # defines symbols that stored machine code needs, as the next
from numba.experimental import function_type as function_type

from spheretwin.models.base import cache, compilation
from spheretwin.models.base.function_identity import entry_name, is_of_package, name_of


def compiled_function(function: Callable[..., Any], **options: Any) -> Any:
    """Return a function compiled with options of `numba.jit`, with a cache for calls from Python."""
    own: Any = jit(function, **options)
    own.compile = compilation.collector_paused()(own.compile)
    own._cache = MachineCode(function, "function")
    own.part = _Part(function, {}, {**own.targetoptions, "no_cpython_wrapper": True}, _PartCompiler)
    own.get_call_template, own.get_overload = own.part.get_call_template, own.part.get_overload
    return own


@compilation.collector_paused()
def c_callback(function: Callable[..., Any], signature: Any, options: dict[str, Any]) -> Any:
    """Return a function compiled as a C callback, as `numba.cfunc` does, with a cache."""
    callback: Any = CFunc(function, (signature.args, signature.return_type), {}, options)
    callback._cache = MachineCode(function, "callback")
    callback.compile()
    return callback


class MachineCode(NullCache):
    """Cache of the machine code of one function; a kind distinguishes different compilations of it."""

    def __init__(self, function: Callable[..., Any], kind: str) -> None:
        self._function, self._kind = function, kind

    def load_overload(self, sig: Any, target_context: Any) -> CompileResult | None:
        """Return the machine code for a signature; None if there is no usable entry."""
        rtsys.initialize(target_context)  # numba's cache would import all that can be compiled, 0.5 s
        entry = entry_name(self._function, self._kind, sig, target_context.codegen().magic_tuple())
        if content := entry and cache.load_entry(entry):
            with suppress(Exception):  # unpickling or linking a damaged entry may raise anything
                signature, parts = pickle.loads(content)
                if signature == sig:  # not a different signature with the same text
                    return CompileResult._rebuild(target_context, *parts)
        compilation.report(name_of(self._function))
        return None

    def save_overload(self, sig: Any, data: CompileResult) -> None:
        """Store the machine code for a signature."""
        if not data.library.has_dynamic_globals:
            if entry := entry_name(self._function, self._kind, sig, data.codegen.magic_tuple()):
                cache.store_entry(entry, dumps((sig, data._reduce())))
        elif is_of_package(self._function):  # users refer to what they like
            cause = f"{name_of(self._function)} holds an address or a large array"
            warnings.warn(f"{cause}: it is compiled in every process", NumbaWarning, stacklevel=2)


class _Part(CPUDispatcher):
    """Function that compiled callers include; it has no machine code of its own."""

    def add_overload(self, cres: CompileResult) -> None:
        result = cres._replace(entry_point=object())  # by which numba finds the code
        self.targetctx.insert_user_function(result.entry_point, result.fndesc, [result.library])
        self.overloads[tuple(result.signature.args)] = result


class _PartCompiler(CompilerBase):
    def define_pipelines(self) -> list[Any]:
        self.state.flags.no_compile = True
        self.state.library = _PartLibrary(self.state.targetctx.codegen(), "part")
        return [DefaultPassBuilder.define_nopython_pipeline(self.state)]


class _PartLibrary(JITCodeLibrary):
    """Code as numba writes it; the callers that include it optimise it."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


types.Record.mangling_args = property(
    lambda record: (f"Record{hashlib.sha256(record.name.encode()).hexdigest()[:24]}", ())
)
