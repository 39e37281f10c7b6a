"""``spheretwin doctor``: state of an installation, and what to install for which purpose."""

from __future__ import annotations

import argparse
import os
import platform
import shutil
import socket
import sys
from collections.abc import Iterator
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple

from spheretwin.cli.bench import PORT
from spheretwin.cli.common import print_json
from spheretwin.cli.options import verb
from spheretwin.machine.link.real_time import PRIORITY, real_time
from spheretwin.models.base import cache
from spheretwin.models.base.extras import PURPOSES, install_command, missing_packages

PACKAGES = ("mujoco", "numba", "llvmlite", "numpy", "scipy", "pyarrow", "pydantic")

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "firefox", "microsoft-edge")

VULKAN_FOLDERS = ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d")
"""Folders in which the drivers of Linux register."""


class Fact(NamedTuple):
    """One line of the report."""

    name: str
    value: str
    ok: bool
    advice: str = ""
    """Advice with its purpose; empty if nothing is missing."""


@verb("--json  print the findings as JSON, alone on stdout")
def run(options: argparse.Namespace) -> bool:
    """Print what is installed, and what is missing for which purpose.

    It prints versions, compile cache, cores, vector width, viewer, browser, ports, permissions for real time,
    and the extras that are missing with the command that installs each. Nothing is changed, and no other
    machine is contacted.
    """
    groups = report()
    if options.json:
        print_json({name: [finding._asdict() for finding in group] for name, group in groups.items()})
    else:
        for name, group in groups.items():
            print(f"{name}:")
            for finding in group:  # lines are not wrapped: commands are copied from them
                print(f"  {finding.name:18} {finding.value}")
                if finding.advice:
                    print(f"  {'':18} -> {finding.advice}")
    return all(finding.ok for finding in groups["needed"])


def report() -> dict[str, list[Fact]]:
    """Return the findings of each group."""
    return {
        "needed": [*versions(), compile_cache(), processor()],
        "to see a run": [viewer(), graphics(), browser(), bench_port()],
        "real time": real_time_permissions(),
        "extras": list(extras()),
    }


def versions() -> Iterator[Fact]:
    """Yield the versions of Python and of the packages that every run needs."""
    yield Fact("spheretwin", version("spheretwin"), ok=True)
    yield Fact("Python", f"{platform.python_version()}, {sys.executable}", ok=True)
    yield Fact("system", f"{platform.system()} {platform.release()}, {platform.machine()}", ok=True)
    for name in PACKAGES:
        try:
            yield Fact(name, version(name), ok=True)
        except PackageNotFoundError:
            yield Fact(name, "missing", ok=False, advice="install spheretwin with its dependencies")


def compile_cache() -> Fact:
    """Return folder, entries and size of the compiled code for these sources."""
    folder, refusal = cache.checked_folder()
    if folder is None:
        advice = "set SPHERETWIN_CACHE_DIR to a folder of your own; else every process compiles again"
        return Fact("compile cache", refusal or "no writable folder", ok=True, advice=advice)
    sizes = [entry.stat().st_size for entry in folder.iterdir()] if folder.is_dir() else []
    if not sizes:
        return Fact("compile cache", f"{folder}: empty", ok=True, advice="the first run compiles, a minute")
    return Fact("compile cache", f"{folder}: {len(sizes)} entries, {sum(sizes) / 1e6:.0f} MB", ok=True)


def processor() -> Fact:
    """Return the cores of this process and the widest vectors of the processor."""
    import llvmlite.binding as llvm

    features = llvm.get_host_cpu_features()
    widths = {"avx512f": 512, "avx2": 256, "sve": 128, "neon": 128, "sse2": 128}
    bits = next((width for name, width in widths.items() if features.get(name)), 128)
    text = f"{usable_cores()} of {os.cpu_count()}, vectors of {bits} bits, {llvm.get_host_cpu_name()}"
    return Fact("cores", text, ok=True)


def usable_cores() -> int:
    """Return the cores that this process may use; not every system can say so."""
    affinity = getattr(os, "sched_getaffinity", None)  # neither macOS nor Windows
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def viewer() -> Fact:
    """Return the path of Rerun's viewer."""
    name = "rerun.exe" if sys.platform == "win32" else "rerun"
    near = Path(sys.executable).with_name(name)
    path = str(near) if near.exists() else shutil.which("rerun")
    if path:
        return Fact("viewer", path, ok=True)
    return Fact("viewer", "no rerun command", ok=False, advice=install_command("record"))


def graphics() -> Fact:
    """Return whether the viewer finds a graphics driver, without starting it."""
    if sys.platform in ("darwin", "win32"):
        return Fact("graphics", "Metal" if sys.platform == "darwin" else "Direct3D 12 or Vulkan", ok=True)
    drivers = [path.stem for folder in VULKAN_FOLDERS for path in sorted(Path(folder).glob("*.json"))]
    screen = os.environ.get("WAYLAND_DISPLAY") or os.environ.get("DISPLAY")
    text = f"{'Vulkan: ' + ', '.join(drivers) if drivers else 'no Vulkan driver'}; screen {screen or 'none'}"
    advice = "" if drivers else "for the viewer: a Vulkan driver, in software mesa-vulkan-drivers"
    if drivers and not screen:
        advice = "without a screen: review RUN --figures DIR, or --live in a browser"
    return Fact("graphics", text, ok=bool(drivers and screen), advice=advice)


def browser() -> Fact:
    """Return a browser for the bench, a live view and pages."""
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path or sys.platform in ("darwin", "win32"):
        return Fact("browser", path or "that of the system", ok=True)
    return Fact("browser", "none on the path", ok=False, advice="for the bench, --live and pages")


def bench_port() -> Fact:
    """Return whether the default port of the bench is free on 127.0.0.1."""
    with socket.socket() as probe, suppress(OSError):
        probe.bind(("127.0.0.1", PORT))
        return Fact("port of the bench", f"{PORT} is free", ok=True)
    return Fact("port of the bench", f"{PORT} is in use", ok=False, advice="bench --port 0 takes a free one")


def real_time_permissions() -> list[Fact]:
    """Return what the system permits to `drive` and `machine --real-time`; it is tried for a moment."""
    with real_time() as granted:
        pass
    texts = (
        ("memory in RAM", granted.locked_memory, "ulimit -l unlimited", "memlock unlimited"),
        ("priority", granted.priority, f"ulimit -r {PRIORITY}", f"rtprio {PRIORITY}"),
    )
    return [
        Fact(
            name,
            "permitted" if permitted else "not permitted",
            ok=permitted,
            advice="" if permitted else f"Linux: {command}, or {limit} in /etc/security/limits.conf",
        )
        for name, permitted, command, limit in texts
    ]


def extras() -> Iterator[Fact]:
    """Yield each extra with its purpose; the advice is the command that installs it."""
    for extra, purpose in PURPOSES.items():
        missing = missing_packages(extra)
        text = f"{purpose}: {'without ' + ', '.join(missing) if missing else 'installed'}"
        yield Fact(extra, text, ok=not missing, advice=install_command(extra) if missing else "")
