"""Marks for tests that need a part which a machine may lack."""

import os
import shutil
import sys
import warnings
from functools import cache

import mujoco
import pytest

from spheretwin.export.compiler import host_compiler
from spheretwin.models.base.compiled import COMPILES

C_COMPILER = host_compiler()

# These tests compile generated C code and run it. CI installs gcc; running the twin needs no compiler.
needs_c_compiler = pytest.mark.skipif(not C_COMPILER, reason="no C compiler")

# The programs on the other side of a link include headers of POSIX: sockets and signals.
needs_posix = pytest.mark.skipif(sys.platform == "win32", reason="no POSIX")

# Windows has no pseudo-terminals, and these tests have no other serial line.
needs_pseudo_terminal = pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo-terminals")

# With NUMBA_DISABLE_JIT functions stay plain Python, for a debugger: they have no address, no machine code.
needs_compiled_functions = pytest.mark.skipif(not COMPILES, reason="NUMBA_DISABLE_JIT is set")


@cache
def has_opengl() -> bool:
    """Whether MuJoCo can draw: with a screen, or without one under MUJOCO_GL=egl and its driver."""
    with warnings.catch_warnings(record=True) as said:  # GLFW only warns that it has no context
        warnings.simplefilter("always")  # an error would leave a context half made
        try:
            mujoco.GLContext(8, 8).free()
        except Exception:  # EGL and OSMesa fail with exceptions of their own
            return False
    return not said


def needs_shell(name: str) -> pytest.MarkDecorator:
    """Return the mark of a test that runs a shell: only the shell itself can read its completion script."""
    return pytest.mark.skipif(not shutil.which(name), reason=f"no {name}")
