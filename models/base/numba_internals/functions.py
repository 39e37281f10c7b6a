"""Compiled functions, for Python or for compiled callers.

*Functions for compiled callers* (`CPUDispatcher`, its `_cache`, `_compiler`, `overloads` and `add_overload`;
`JITCodeLibrary`, the flag `no_compile`). Reason: numba optimises each function completely, makes machine code
and a conversion of Python arguments of it, and does the same again in each caller that includes it; without
that the first run compiles in three quarters of the time. Consequence of a change: a loop compiles longer, or
a function is compiled at every call.

*No reference counting* (`_nrt`). Reason: it takes a third of the loop's own time. Consequence: the option is
refused, or the loop is slower.

`tests/models/base/test_internals.py` checks each of them.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from numba.core import event
from numba.core.caching import NullCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompilerBase, CompileResult, DefaultPassBuilder
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager
from numba.core.dispatcher import Dispatcher as Dispatcher  # the class of compiled functions
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature

from spheretwin.models.base.numba_internals.machine_code import MachineCode

NO_ALLOCATION: dict[str, Any] = {"_nrt": False}
"""Options of a compiled function that creates no array: it counts no references."""


class _Nesting(threading.local):
    """Number of functions that a thread compiles for compiled callers, one inside the other."""

    depth = 0


_NESTING = _Nesting()


class _Part:
    """Key by which numba finds a function without machine code."""


class _PartLibrary(JITCodeLibrary):
    """Code that is optimised as far as its size goes; the callers that include it optimise it fully."""

    def _optimize_final_module(self) -> None:
        passes, builder = self._codegen._module_pass_manager(
            loop_vectorize=False, slp_vectorize=False, opt=1, cost="cheap"
        )
        passes.run(self._final_module, builder)

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


class CompiledFunction(CPUDispatcher):
    """Compiled function that Python can call after the first call from Python.

    For a compiled caller it is compiled without the conversion of its arguments, which takes longer to
    compile than most functions; the first call from Python compiles it again, with the conversion.
    """

    _cache: Any
    _part_cache: Any = NullCache()
    """Of the machine code for compiled callers."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Compile the function for a compiled caller; return its signature."""
        _NESTING.depth += 1
        try:
            return super().get_call_template(args, kws)
        finally:
            _NESTING.depth -= 1

    def compile(self, sig: Any) -> Any:
        """Compile the function for a signature; return what Python calls."""
        with global_compiler_lock:
            arguments, is_part = tuple(normalize_signature(sig)[0]), _NESTING.depth > 0
            known = self.overloads.get(arguments)
            if known is not None and not is_part and not _is_callable(known):
                del self.overloads[arguments]
            self._compiler.targetoptions = {**self.targetoptions, "no_cpython_wrapper": is_part}
            if is_part and self._compiler.pipeline_class is PartCompiler:
                return self._compile_part(arguments)
            cache, self._cache = self._cache, self._part_cache if is_part else self._cache
            try:
                return super().compile(sig)
            finally:
                self._cache = cache

    def _compile_part(self, arguments: tuple[Any, ...]) -> _Part:
        """Compile the function as code that its callers include; it has no machine code of its own."""
        if arguments not in self.overloads:
            with event.trigger_event("numba:compile", data={"dispatcher": self}):
                result = self._compiler.compile(arguments, None)
            result = result._replace(entry_point=_Part())
            target = result.target_context
            target.insert_user_function(result.entry_point, result.fndesc, [result.library])
            self.overloads[arguments] = result
        return self.overloads[arguments].entry_point

    def add_overload(self, cres: CompileResult) -> None:
        """Add the machine code of a signature; calls from Python find only what Python can call."""
        if _is_callable(cres):
            super().add_overload(cres)
        else:
            self.overloads[tuple(cres.signature.args)] = cres


def _is_callable(result: CompileResult) -> bool:
    """True if Python can call the machine code of a function."""
    if isinstance(result.entry_point, _Part):
        return False
    wrapper = result.fndesc.llvm_cpython_wrapper_name
    return bool(result.library.get_pointer_to_function(wrapper))


def compiled_function(
    function: Callable[..., Any], *, pipeline_class: type[CompilerBase] = Compiler, **options: Any
) -> CompiledFunction:
    """Return a compiled function with a cache.

    Parameters
    ----------
    function : callable
        A plain function of this package.
    pipeline_class : type
        Compiler.
    **options
        Of `numba.njit`.
    """
    own = CompiledFunction(function, {}, {"nopython": True, "boundscheck": None, **options}, pipeline_class)
    own._cache, own._part_cache = MachineCode(function, "function"), MachineCode(function, "part")
    return own


class PartCompiler(CompilerBase):
    """Numba's compiler without machine code for functions that compiled functions call."""

    def define_pipelines(self) -> list[PassManager]:
        """Return the passes."""
        if _NESTING.depth:
            self.state.flags.no_compile = True
            self.state.library = _PartLibrary(self.state.targetctx.codegen(), "part")
        return [DefaultPassBuilder.define_nopython_pipeline(self.state)]
