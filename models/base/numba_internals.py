"""Private APIs of numba, all in this file. `pyproject.toml` bounds the versions.

*Machine code in a cache of this package* (`MachineCode`, `CompileResult._rebuild` and `_reduce`, `rtsys`,
`_cache`). Reason: numba's cache tracks one file of sources, and a damaged entry is an error at every call.
Consequence of a change: a function is compiled in every process, or an exception at its first call.

*Functions for compiled callers* (`CPUDispatcher`, its `_compiler`, `overloads` and `add_overload`). Reason:
numba compiles the conversion of Python arguments of every function, a fifth of the compile time of a loop.
Consequence: a loop compiles longer, or a function is compiled at every call.

*Inlined implementations without machine code* (`make_overload_template`, `_get_jit_decorator`,
`_can_compile`). Reason: numba compiles an implementation completely, then inlines it and drops the code, a
tenth of the compile time of a loop. Consequence: the loop does not compile, or takes longer.

*Functions by address* (`cgutils`, `FunctionType`). Reason: the loop is compiled once for all laws.
Consequence: the loop does not compile.

*Values in memory* (`get_data_type`, `get_abi_sizeof`). Reason: C code passes an address to compiled code,
which reads a tuple of arrays there. Consequence: a plugin reads invalid memory.

*No reference counting* (`_nrt`). Reason: it takes a third of the loop's own time. Consequence: the option is
refused, or the loop is slower.

*Tuples as values* (`Lower._find_singly_assigned_variable`). Reason: numba gives each variable that several
blocks use a place in memory, and LLVM spends most of the compile time on copies of tuples of many arrays.
Consequence: the loop compiles two to three times as long.

*Fingerprint of types* (`_dispatcher.compute_fingerprint`). Reason: numba's type of the hundred arrays of a
loop takes half of the start-up time of a session. Consequence: an exception at the first loop.

*Callbacks with bounds checks and exceptions* (`CFunc`, `Dispatcher`, the text of `sys.unraisablehook`).
Reason: numba checks bounds only in the outermost function, and drops the exceptions of callbacks.
Consequence: an exception of a law is printed, and the run ends as diverged.

`tests/models/base/test_internals.py` checks each of them.
"""

from __future__ import annotations

import hashlib
import pickle
import re
import sys
import threading
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import CellType, FunctionType
from typing import Any

import llvmlite.binding
import numpy as np
from llvmlite import ir
from numba import _dispatcher, njit, typeof, types
from numba.core import cgutils
from numba.core import ir as numba_ir
from numba.core.analysis import compute_cfg_from_blocks, compute_use_defs, must_use_alloca
from numba.core.caching import NullCache
from numba.core.ccallback import CFunc
from numba.core.compiler import Compiler, CompilerBase, CompileResult, DefaultPassBuilder
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.dispatcher import Dispatcher as Dispatcher  # the class of compiled functions
from numba.core.errors import NumbaWarning
from numba.core.lowering import Lower
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.runtime import rtsys
from numba.core.serialize import dumps
from numba.core.sigutils import normalize_signature
from numba.core.typed_passes import NativeLowering
from numba.core.typing.templates import infer, infer_global, make_overload_template
from numba.cpython import hashing
from numba.experimental import function_type
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

from spheretwin.models.base import cache, compilation

# Loaded machine code needs the symbols of hashes and the type of a callback, in addition to the math and
# run-time libraries. These imports register them.
_REGISTERED = hashing, function_type


NO_ALLOCATION: dict[str, Any] = {"_nrt": False}
"""Options of a compiled function that creates no array: it counts no references."""


class MachineCode(NullCache):
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
        result = self._rebuilt(content, sig, target_context) if content else None
        if result is None:
            compilation.report(self._name)
        return result

    @staticmethod
    def _rebuilt(content: bytes, sig: Any, target_context: Any) -> CompileResult | None:
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
        enclosed = _enclosed(self._function)
        for_caller = _NESTING.depth > 0
        key = repr((self._name, line, enclosed, self._kind, for_caller, str(sig), codegen.magic_tuple()))
        readable = re.sub(r"\W+", "-", self._name.removeprefix("spheretwin."))[:60]
        return f"{readable}-{hashlib.sha256(key.encode()).hexdigest()[:24]}"


def _enclosed(function: Callable[..., Any]) -> list[Any]:
    """Return the values that a function encloses, the same in each process.

    Pickled, a compiled function is different in each process. One of this package is defined by its name, its
    line and what it encloses: the cache tracks its source.
    """
    identities: list[Any] = []
    for cell in function.__closure__ or ():
        plain = getattr(cell.cell_contents, "py_func", None)
        if plain is not None and plain.__module__.startswith("spheretwin."):
            line = plain.__code__.co_firstlineno
            identities.append((plain.__module__, plain.__qualname__, line, _enclosed(plain)))
        else:
            identities.append(dumps(cell.cell_contents))
    return identities


def fingerprint_of_types(values: tuple[Any, ...]) -> bytes:
    """Return a key of numba's types of values: values with one key have one type.

    Numba itself looks up the type of an argument by it. It has the names of a named tuple's class and fields,
    and no two classes of this package share both.

    Raises
    ------
    NotImplementedError
        A value is no number, array or tuple of them.
    """
    key: bytes = _dispatcher.compute_fingerprint(values)
    return key


class _Nesting(threading.local):
    """Number of functions that a thread compiles for compiled callers, one inside the other."""

    depth = 0


_NESTING = _Nesting()


class CompiledFunction(CPUDispatcher):
    """Compiled function that Python can call after the first call from Python.

    For a compiled caller it is compiled without the conversion of its arguments, which takes longer to
    compile than most functions; the first call from Python compiles it again, with the conversion.
    """

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
            return super().compile(sig)

    def add_overload(self, cres: CompileResult) -> None:
        """Add the machine code of a signature; calls from Python find only what Python can call."""
        if _is_callable(cres):
            super().add_overload(cres)
        else:
            self.overloads[tuple(cres.signature.args)] = cres


def _is_callable(result: CompileResult) -> bool:
    """True if Python can call the machine code of a function."""
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
    own._cache = MachineCode(function, "function")
    return own


class _TupleLower(Lower):
    """Translation to LLVM in which a tuple that is assigned once is a value, not a place in memory.

    For functions without reference counting: numba may release a variable where it has no value.
    """

    def _find_singly_assigned_variable(self) -> None:
        super()._find_singly_assigned_variable()
        blocks = self.func_ir.blocks
        dominators, flow = compute_cfg_from_blocks(blocks).dominators(), compute_use_defs(blocks)
        assignments = Counter(
            statement.target.name
            for block in blocks.values()
            for statement in block.find_insts(numba_ir.Assign)
        )
        in_memory = must_use_alloca(blocks)
        for label, names in flow.defmap.items():
            for name in names:
                is_tuple = isinstance(self.typeof(name), types.BaseTuple)
                if not is_tuple or assignments[name] != 1 or name in in_memory:
                    continue
                users = [user for user, used in flow.usemap.items() if name in used]
                # Blocks are translated in the order of their labels.
                if all(label < user and label in dominators[user] for user in users):
                    self._singly_assigned_vars.add(name)


@register_pass(mutates_CFG=True, analysis_only=False)
class _TupleLowering(NativeLowering):
    """Pass with this translation."""

    _name = "tuple_lowering"

    @property
    def lowering_class(self) -> type[Lower]:
        return _TupleLower


class TupleCompiler(CompilerBase):
    """Numba's compiler with tuples as values."""

    def define_pipelines(self) -> list[PassManager]:
        """Return the passes."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [
            (_TupleLowering if kind is NativeLowering else kind, name) for kind, name in passes.passes
        ]
        passes.finalize()
        return [passes]


def inline_overload(function: Callable[..., Any], implementation: Callable[..., Any], **options: Any) -> None:
    """Inline what `implementation` returns for the argument types into compiled callers.

    As ``numba.extending.overload(function, inline="always")``, without machine code of the implementation.

    Parameters
    ----------
    function : callable
        Plain function.
    implementation : callable
        Returns a plain function for types of arguments, or None.
    **options
        Of `numba.jit`.
    """
    jit_options = {"no_cpython_wrapper": True, **options}
    complete: Any = make_overload_template(function, implementation, jit_options, False, "always")

    class Typed(complete):
        def _get_jit_decorator(self) -> Callable[..., Any]:
            def decorator(function: Callable[..., Any]) -> Any:
                dispatcher = njit(**jit_options)(function)
                dispatcher._can_compile = False  # the inliner infers the types by itself
                return dispatcher

            return lambda **_: decorator

    infer(Typed)
    infer_global(function, types.Function(Typed))


def c_callback(
    signature: Any, function: Callable[..., Any], options: dict[str, Any], check_bounds: bool
) -> Any:
    """Compile a plain function as a C callback, whose field `address` is its address."""
    step = _with_bounds_checks(function, {}) if check_bounds else function
    options = {**options, "boundscheck": check_bounds}
    callback: Any = CFunc(step, (signature.args, signature.return_type), {}, options)
    # The cache tracks the sources of this package only; entries of others would become stale.
    if function.__module__.startswith("spheretwin.") and not check_bounds:
        callback._cache = MachineCode(function, "callback")
    callback.compile()
    return callback


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


def _with_bounds_checks(function: Any, copies: dict[int, Any]) -> FunctionType:
    """Copy a plain function so that the compiled functions that it calls by name check bounds.

    Numba checks bounds in the function that it compiles, but not in functions that this function calls.

    Parameters
    ----------
    function : function
    copies : dict
        Copies of compiled functions made so far, by the identity of the original.
    """
    copy = _copied(function)
    _name_copies(function, copy, copies)
    return copy


def _dispatcher_with_bounds_checks(value: Any, copies: dict[int, Any]) -> Any:
    """Copy a compiled function so that it checks bounds; return any other value unchanged."""
    if not isinstance(value, Dispatcher):
        return value
    if id(value) not in copies:
        copy = _copied(value.py_func)
        options = {**value.targetoptions, "boundscheck": True}
        copies[id(value)] = type(value)(copy, value.locals, options)
        _name_copies(value.py_func, copy, copies)  # last: functions may call each other
    return copies[id(value)]


def _copied(function: Any) -> FunctionType:
    """Copy a function, with its own global variables and with empty cells."""
    cells = tuple(CellType() for _ in function.__closure__ or ())
    copy = FunctionType(
        function.__code__, dict(function.__globals__), function.__name__, function.__defaults__, cells
    )
    copy.__module__, copy.__qualname__ = function.__module__, function.__qualname__
    return copy


def _name_copies(function: Any, copy: FunctionType, copies: dict[int, Any]) -> None:
    """Let the copy of a function name the copies of the compiled functions that the original names."""
    for name in set(function.__code__.co_names) & function.__globals__.keys():
        copy.__globals__[name] = _dispatcher_with_bounds_checks(function.__globals__[name], copies)
    for original, cell in zip(function.__closure__ or (), copy.__closure__ or (), strict=True):
        cell.cell_contents = _dispatcher_with_bounds_checks(original.cell_contents, copies)


class _CallbackErrors(threading.local):
    """Receiver of the exceptions of compiled callbacks, one for each thread."""

    receiver: Callable[[BaseException], None] | None = None


_CALLBACK_ERRORS = _CallbackErrors()
_HOOK_LOCK = threading.Lock()
_HOOKS: list[Callable[[Any], object]] = []
"""Previous hook, once for each running block."""


@contextmanager
def callback_errors(receiver: Callable[[BaseException], None]) -> Iterator[None]:
    """Pass exceptions of compiled callbacks in this thread to a function, while the block runs.

    A callback cannot raise into the compiled code that calls it. Numba hands its exception to
    `sys.unraisablehook`, which prints it, and the caller goes on.

    Parameters
    ----------
    receiver : callable
        Called before the callback returns to its caller.
    """
    with _HOOK_LOCK:
        _HOOKS.append(_HOOKS[0] if _HOOKS else sys.unraisablehook)
        sys.unraisablehook = _receive
    outer, _CALLBACK_ERRORS.receiver = _CALLBACK_ERRORS.receiver, receiver
    try:
        yield
    finally:
        _CALLBACK_ERRORS.receiver = outer
        with _HOOK_LOCK:
            before = _HOOKS.pop()
            if not _HOOKS:
                sys.unraisablehook = before


def _receive(unraisable: Any) -> None:
    """Pass on the exception of a callback; leave every other to the hook that was there before."""
    # Numba names the compiler's context as the place, whatever the callback is.
    is_callback = "CPUContext" in f"{unraisable.object}"
    if _CALLBACK_ERRORS.receiver and is_callback:
        _CALLBACK_ERRORS.receiver(unraisable.exc_value or unraisable.exc_type())
    else:
        (_HOOKS[0] if _HOOKS else sys.__unraisablehook__)(unraisable)
