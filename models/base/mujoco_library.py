"""MuJoCo's own shared library: its functions by address, and its messages kept quiet."""

import ctypes
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from threading import Lock

import mujoco

from spheretwin.models.base.errors import EngineError


@cache
def library() -> ctypes.CDLL:
    """The library that the `mujoco` package has loaded."""
    folder = Path(mujoco.__file__).parent
    for pattern in ("libmujoco.so.*", "libmujoco.*.dylib", "mujoco.dll"):
        for path in folder.glob(pattern):
            return ctypes.CDLL(str(path))
    raise EngineError(f"engine: expected MuJoCo's shared library in {folder}, found none")


@ctypes.CFUNCTYPE(None, ctypes.c_char_p)
def _quiet(_: bytes) -> None:
    """Take a warning; MuJoCo counts it in `mjData.warning`, where a run looks for it."""


@contextmanager
def timers_stopped() -> Iterator[None]:
    """Run MuJoCo without its profiling timers (`mjData.timer`), which take half of the step of a small model.

    They read the clock 98 times a step of RK4. The switch is one for the whole process, so it is for a
    program to set, not for a library: `mujoco` has no function for it that Python can call.
    """
    clock = ctypes.c_void_p.in_dll(library(), "mjcb_time")
    before, clock.value = clock.value, None
    try:
        yield
    finally:
        clock.value = before


_COMPILING = Lock()  # Python's warnings are one list for all threads


@contextmanager
def compiler_warnings() -> Iterator[list[str]]:
    """Give a list of what MuJoCo's compiler warns of while the block runs: a line each, none twice.

    Its Python package raises them as warnings, several lines each, again at each compilation.
    """
    lines: list[str] = []
    with _COMPILING, warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always")
        yield lines
        lines += dict.fromkeys(" ".join(str(warning.message).split()) for warning in raised)


def silence_warnings() -> None:
    """Keep warnings from stderr and from a log file in the current folder, MuJoCo's default."""
    handler = ctypes.c_void_p.in_dll(library(), "mju_user_warning")
    handler.value = ctypes.cast(_quiet, ctypes.c_void_p).value
