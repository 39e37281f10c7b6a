"""Private APIs of MuJoCo and pointers into its shared library, all in this file.

*Addresses of models and data* (`MjModel._address`, `MjData._address`) and of `mj_step`. Reason: compiled code
steps the engine without Python. Consequence of a change: an exception at the start of a session, and after
a change of the C function an invalid access to memory.

*Pointers of the library* (`mjcb_time`, `mju_user_warning`). Reason: `mujoco` has no function for them that
Python can call. Consequence of a change: an exception at the first model or command.

`tests/models/base/test_internals.py` checks each of them; `pyproject.toml` bounds the versions.
"""

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
    """Return the library that the `mujoco` package has loaded."""
    folder = Path(mujoco.__file__).parent
    for pattern in ("libmujoco.so.*", "libmujoco.*.dylib", "mujoco.dll"):
        for path in folder.glob(pattern):
            return ctypes.CDLL(str(path))
    raise EngineError(f"engine: expected MuJoCo's shared library in {folder}, found none")


def addresses(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[int, int]:
    """Return the addresses of a model and of its data; they are valid as long as both objects exist."""
    return model._address, data._address


def step_address() -> int:
    """Return the address of `mj_step`, a C function of the addresses of a model and of its data."""
    return ctypes.cast(library().mj_step, ctypes.c_void_p).value or 0


def _ignore(_: bytes) -> None:
    """Ignore a warning; MuJoCo counts it in `mjData.warning`, which a run reads."""


_quiet = ctypes.CFUNCTYPE(None, ctypes.c_char_p)(_ignore)


@contextmanager
def timers_stopped() -> Iterator[None]:
    """Run MuJoCo without its profiling timers (`mjData.timer`), which take half of the step of a small model.

    They read the clock 98 times a step of RK4. The switch is global to the process, so that a program sets
    it, not a library: `mujoco` has no function for it that Python can call.
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
    """Yield a list of the warnings of MuJoCo's compiler during the block: one line each, without repetition.

    The Python package raises them as warnings of several lines each, again at each compilation.
    """
    lines: list[str] = []
    with _COMPILING, warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always")
        yield lines
        lines += dict.fromkeys(" ".join(str(warning.message).split()) for warning in raised)


def silence_warnings() -> None:
    """Suppress MuJoCo's warnings on stderr and in a log file in the current folder."""
    handler = ctypes.c_void_p.in_dll(library(), "mju_user_warning")
    handler.value = ctypes.cast(_quiet, ctypes.c_void_p).value
