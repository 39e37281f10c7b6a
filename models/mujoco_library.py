"""MuJoCo's own shared library: its functions by address, and its messages kept quiet."""

import ctypes
from functools import cache
from pathlib import Path

import mujoco

from spheretwin.models.errors import EngineError


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


def silence_warnings() -> None:
    """Keep warnings from stderr and from a log file in the current folder, MuJoCo's default."""
    handler = ctypes.c_void_p.in_dll(library(), "mju_user_warning")
    handler.value = ctypes.cast(_quiet, ctypes.c_void_p).value
