"""Versions of all that a figure may depend on."""

import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version

PACKAGES = ("spheretwin", "mujoco", "numba", "numpy", "scipy", "pydantic", "pyarrow", "rerun-sdk")


@cache
def versions() -> dict[str, str]:
    """Version of Python and of every package that a figure may depend on."""
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found
