"""Compilation of generated C: for this machine, or for other platforms by the extra `cross`."""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from spheretwin.models.base.errors import InputError, SpheretwinError, did_you_mean
from spheretwin.models.base.extras import missing


class Platform(NamedTuple):
    """Platform of a shared library."""

    name: str
    """As FMI 3 names it."""
    fmi2: str | None
    """As FMI 2 names it; None if it has no name."""
    zig: str
    suffix: str


TARGETS = {
    target.name: target
    for target in (
        Platform("x86_64-linux", "linux64", "x86_64-linux-gnu.2.17", ".so"),
        Platform("aarch64-linux", None, "aarch64-linux-gnu.2.17", ".so"),
        Platform("x86_64-windows", "win64", "x86_64-windows-gnu", ".dll"),
        Platform("x86_64-darwin", "darwin64", "x86_64-macos", ".dylib"),
        Platform("aarch64-darwin", None, "aarch64-macos", ".dylib"),
    )
}

FLAGS = ("-std=c99", "-O2", "-g0", "-ffp-contract=off", "-fPIC", "-fvisibility=hidden", "-shared")


def this_machine() -> Platform | None:
    """Return the platform of this machine; None if it is not in `TARGETS`."""
    machine = {"AMD64": "x86_64", "arm64": "aarch64"}.get(platform.machine(), platform.machine())
    return TARGETS.get(f"{machine}-{platform.system().lower()}")


def host_compiler() -> list[str] | None:
    """Return the command of the C compiler of this machine; None if there is none."""
    path = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    return [path] if path else None


def cross_compiler(name: str) -> tuple[Platform, list[str]]:
    """Return a platform and the command of the compiler for it.

    Raises
    ------
    InputError
        An unknown platform, or the extra is not installed.
    """
    if name not in TARGETS:
        raise InputError(
            f"export: expected a target {', '.join(TARGETS)}, received {name}{did_you_mean(name, TARGETS)}"
        )
    if find_spec("ziglang") is None:
        raise missing("export", "ziglang", "cross")
    return TARGETS[name], [sys.executable, "-m", "ziglang", "cc", "-target", TARGETS[name].zig]


def compile_library(command: Sequence[str], sources: Sequence[Path], library: Path) -> None:
    """Compile C sources to a shared library.

    Raises
    ------
    SpheretwinError
        The compiler reported an error.
    """
    arguments = [*command, *FLAGS, "-o", str(library), *map(str, sources), "-lm"]
    done = subprocess.run(arguments, capture_output=True, text=True, check=False)
    if done.returncode:
        lines = [line for line in done.stderr.splitlines() if line.strip()]
        first = next((line for line in lines if "error" in line), lines[0] if lines else "no message")
        raise SpheretwinError(f"export: expected {library.name} to compile, {first.strip()}")
