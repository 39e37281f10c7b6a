"""Copy of the package in its installed form: `twin` is the package itself, the other folders stand in it."""

import shutil
from pathlib import Path

ROOT = Path(__file__).parents[1]
INSTALLED_AS = {"twin": ".", "models": "models", "control": "control", "viz": "viz"}


def copy_package(folder: Path) -> Path:
    """Copy the sources into `folder`; returns the package, ``folder/spheretwin``."""
    package = folder / "spheretwin"
    for source, place in INSTALLED_AS.items():
        shutil.copytree(ROOT / source, package / place, ignore=shutil.ignore_patterns("__pycache__"))
    return package
