"""List the packages: `twin` installs as `spheretwin`, the other folders below it.

A top-level `control` would overwrite python-control.
"""

from setuptools import find_packages, setup

ROOTS = {
    "spheretwin": "twin",
    "spheretwin.models": "models",
    "spheretwin.control": "control",
    "spheretwin.viz": "viz",
}

setup(
    packages=[
        name
        for root, folder in ROOTS.items()
        for name in (root, *(f"{root}.{package}" for package in find_packages(folder)))
    ],
    package_dir=ROOTS,
)
