"""CUDA through numba-cuda: the only module that refers to that package. It is imported where a GPU is used.

The functions of a GPU are those of the processor: numba-cuda compiles what a kernel calls, with the vectors
and the records as they are. Functions of NumPy that laws use, such as the square root, are missing there.
numba-cuda has no public way to add them, so its table is extended here by functions of CUDA's library.

With ``NUMBA_ENABLE_CUDASIM=1`` numba's simulator runs the kernel in Python and what it calls on the
processor; it needs neither package nor GPU.
"""

from __future__ import annotations

import threading
from functools import cache
from importlib.util import find_spec
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import cuda
from numba.core import cgutils

from spheretwin.models.base.errors import InputError, without_breaks
from spheretwin.models.base.extras import missing

THREADS = 64
"""Threads of a group."""

_ONE_AT_A_TIME = threading.Lock()

SIMULATED = bool(numba.config.ENABLE_CUDASIM)


@cache
def check_gpu() -> str:
    """Return the name of the GPU.

    Raises
    ------
    InputError
        The package is not installed, or there is no GPU that it can use.
    """
    if SIMULATED:
        return "simulator"
    if not find_spec("numba_cuda"):  # numba itself has a module `cuda` that is not maintained
        raise missing("cuda", "numba-cuda", "gpu")
    try:
        name = cuda.get_current_device().name
    except Exception as error:  # numba-cuda, cuda-bindings and cuda-core have no common exception
        received = without_breaks(error).rstrip(" :")
        raise InputError(f"cuda: expected a GPU of NVIDIA with its driver, received {received}") from None
    return name.decode() if isinstance(name, bytes) else str(name)


def kernel_of(body: Any, record: np.dtype[Any], numbers: int) -> Any:
    """Return a kernel that works on one record in each thread.

    The record is copied into memory of the thread, where those of neighbouring threads are interleaved, and
    back at the end; used in place it would be seven times slower.

    Parameters
    ----------
    body : callable
        Plain function ``(place, record, row, arguments)``, of the place of the record and the arguments of
        the kernel.
    record : dtype
    numbers : int
        Of `row`, (1, numbers), memory of the thread.

    Returns
    -------
    kernel
        Of one tuple of arguments. The first one is the array (records, words) of the records as whole
        numbers.
    """
    words = record.itemsize // 8
    # As `compiled.allocation_free`, without its cache: addresses of functions cannot be stored.
    call = numba.njit(body, error_model="numpy", _nrt=False)

    def work(arguments: Any) -> None:
        place, kept = cuda.grid(1), arguments[0]
        if place < kept.shape[0]:
            records, row = cuda.local.array(1, record), cuda.local.array((1, numbers), np.float64)
            own = records.view(np.int64)
            for word in range(words):
                own[word] = kept[place, word]
            call(place, records[0], row, arguments)
            for word in range(words):
                kept[place, word] = own[word]

    _add_functions()
    return cuda.jit(work)


def launch(kernel: Any, threads: int, arguments: tuple[Any, ...]) -> None:
    """Run a kernel in as many threads, with arrays of `on_device`; return when all have ended."""
    with _ONE_AT_A_TIME:  # each one fills the GPU, and waits for the compiler
        kernel[-(-threads // THREADS), THREADS](arguments)
        cuda.synchronize()


def on_device(value: Any) -> Any:
    """Copy an array to the GPU, or each array of a tuple; other values stay."""
    if isinstance(value, tuple):
        copies = [on_device(entry) for entry in value]
        return type(value)(*copies) if hasattr(value, "_fields") else tuple(copies)
    if not isinstance(value, np.ndarray):
        return value
    return value.copy() if SIMULATED else cuda.to_device(with_own_strides(value))


def with_own_strides(value: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return an array in the order of C, whose strides follow from its shape.

    NumPy also regards an array as contiguous if an axis of one entry has a stride of zero. numba-cuda takes
    that for another type, and would compile the kernel again.
    """
    return value.copy() if 0 in value.strides else np.ascontiguousarray(value)


def borrowed(value: Any) -> Any:
    """Return an array of another package on the GPU, not copied; of NumPy, copied; None if it is no array."""
    try:
        if SIMULATED or isinstance(value, np.ndarray):
            return on_device(np.asarray(value))
        return cuda.as_cuda_array(value)
    except (TypeError, ValueError):
        return None


def send(value: np.ndarray[Any, Any], copy: Any) -> None:
    """Copy an array into its copy of `on_device`."""
    if SIMULATED:
        copy[...] = value
    else:
        copy.copy_to_device(value)


def fetch(copy: Any, value: Any) -> None:
    """Copy what `on_device` has returned back into its arrays."""
    if isinstance(value, tuple):
        for entries in zip(copy, value, strict=True):
            fetch(*entries)
    elif not isinstance(value, np.ndarray):
        return
    elif SIMULATED:
        value[...] = copy
    else:
        copy.copy_to_host(value)


_OF_LIBRARY = {
    np.absolute: "fabs",
    np.cbrt: "cbrt",
    np.ceil: "ceil",
    np.copysign: "copysign",
    np.exp: "exp",
    np.expm1: "expm1",
    np.fabs: "fabs",
    np.floor: "floor",
    np.fmod: "fmod",
    np.log1p: "log1p",
    np.power: "pow",
    np.rint: "rint",
    np.sqrt: "sqrt",
    np.trunc: "trunc",
}


@cache
def _add_functions() -> None:
    if SIMULATED:
        return
    from numba.cuda.ufuncs import ufunc_db

    table = ufunc_db()
    for function, name in _OF_LIBRARY.items():
        if function not in table:
            table[function] = {f"{'d' * function.nin}->d": _of_library(name)}
    own = {np.sign: ("d->d", _sign), np.square: ("d->d", _square), np.isfinite: ("d->?", _is_finite)}
    for other, (kind, implementation) in own.items():
        if other not in table:
            table[other] = {kind: implementation}


def _of_library(name: str) -> Any:
    """Return the implementation of a function of numbers in double precision by CUDA's library."""

    def call(context: Any, builder: Any, signature: Any, given: Any, loc: Any = None) -> Any:
        kind = ir.FunctionType(ir.DoubleType(), [ir.DoubleType()] * len(given))
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"__nv_{name}"), given)

    return call


def _sign(context: Any, builder: Any, signature: Any, given: Any, loc: Any = None) -> Any:
    x, one, zero = given[0], ir.Constant(ir.DoubleType(), 1.0), ir.Constant(ir.DoubleType(), 0.0)
    below = builder.select(builder.fcmp_ordered("<", x, zero), ir.Constant(ir.DoubleType(), -1.0), x)
    return builder.select(builder.fcmp_ordered(">", x, zero), one, below)  # 0 or NaN stays


def _square(context: Any, builder: Any, signature: Any, given: Any, loc: Any = None) -> Any:
    return builder.fmul(given[0], given[0])


def _is_finite(context: Any, builder: Any, signature: Any, given: Any, loc: Any = None) -> Any:
    size = _of_library("fabs")(context, builder, signature, given)
    return builder.fcmp_ordered("<", size, ir.Constant(ir.DoubleType(), np.inf))
