"""Optional packages: purpose of each extra, and the command that adds it to this installation."""

from __future__ import annotations

import json
import re
import shlex
import sys
from importlib.metadata import Distribution, distribution
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

from spheretwin.models.base.errors import InputError

PURPOSES = {
    "record": "recordings of runs, their live view and their review",
    "plots": "figures and pages of studies, experiments and reviews",
    "bench": "the page in a browser that drives the twin",
    "video": "clips of runs as MP4",
    "tables": "runs as tables of pandas, polars and xarray",
    "hdf5": "runs as HDF5 files",
    "magnetics": "torque curve and field from the geometry",
    "machine": "logs as MCAP, live data for Foxglove and ROS 2, a machine at a serial line",
    "rl": "environments of Gymnasium, trained networks as laws",
    "control": "linear models, plant and loop as systems of python-control",
    "tune": "search for gains",
    "cluster": "studies on a Ray cluster",
    "gpu": "studies on a GPU of NVIDIA",
    "meshes": "new meshes of the actuator",
    "casadi": "dynamics as CasADi functions, predictive control",
    "fmu": "simulation and check of exported FMUs",
    "cross": "exported C code for other platforms",
    "fem": "field of the iron hoop by finite elements",
}
"""Purpose of each extra, the most common first; the extra all has those of all others except gpu."""


def missing(place: str, package: str, extra: str, purpose: str = "") -> InputError:
    """Return the error about a package that is not installed, with the command that installs its extra."""
    wanted = f"{package} {purpose}".strip()
    return InputError(
        f"{place}: expected {wanted}, which the extra {extra} installs: {install_command(extra)}"
    )


def check_recordings(place: str) -> None:
    """Check that recordings can be written and read.

    Parameters
    ----------
    place : str
        What needs them, for the message.

    Raises
    ------
    InputError
        Rerun is not installed.
    """
    if find_spec("rerun") is None:
        raise missing(place, "rerun-sdk", "record", "for recordings")


def install_command(*extras: str) -> str:
    """Return the command that adds extras to this installation.

    A clone that `make` has set up has no pip in its environment; other environments may lack it, too.
    """
    source = _source_folder()
    if source and (source / "uv.lock").is_file() and Path(sys.prefix).resolve() == source / ".venv":
        return f"make -C {shlex.quote(str(source))} extras EXTRAS={shlex.quote(' '.join(extras))}"
    named = f"[{','.join(extras)}]"
    target = ["-e", f"{source}{named}"] if source else [f"spheretwin{named}"]
    if find_spec("pip"):
        return shlex.join([sys.executable, "-m", "pip", "install", *target])
    return shlex.join(["uv", "pip", "install", "--python", sys.executable, *target])


def missing_packages(extra: str) -> list[str]:
    """Return the packages of an extra that are not installed."""
    names = [
        match[0]
        for requirement in distribution("spheretwin").requires or ()
        if re.search(rf"extra == ['\"]{extra}['\"]", requirement)
        and (match := re.match(r"[\w.-]+", requirement))
    ]
    return [name for name in names if not _is_installed(name)]


def _is_installed(name: str) -> bool:
    return any(True for _ in Distribution.discover(name=name))


def _source_folder() -> Path | None:
    """Return the folder of an editable installation; None for any other."""
    text = distribution("spheretwin").read_text("direct_url.json")
    facts = json.loads(text) if text else {}
    if not facts.get("dir_info", {}).get("editable"):
        return None
    return Path(url2pathname(urlsplit(facts["url"]).path)).resolve()
