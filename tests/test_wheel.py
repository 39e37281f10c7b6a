"""What installs: one top-level name, with every file that a run needs."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.package_copy import INSTALLED_AS

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def names(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    # Built from a copy: setuptools would leave its own folders in the tree.
    source = folder / "source"
    listing = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    captured = {"capture_output": True, "text": True, "check": True}
    files = subprocess.run(listing, cwd=ROOT, **captured).stdout
    for name in filter(None, files.split("\0")):
        if (ROOT / name).is_file():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            (source / name).write_bytes((ROOT / name).read_bytes())
    code = "import setuptools.build_meta as b; print(b.build_wheel('..'))"
    built = subprocess.run([sys.executable, "-c", code], cwd=source, **captured)
    with zipfile.ZipFile(folder / built.stdout.split()[-1]) as wheel:
        return wheel.namelist()


def test_only_top_level_name_is_spheretwin(names):
    # A top-level `control` would overwrite python-control, without a word from pip.
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == {"spheretwin"}


def test_data_files_come_along(names):
    for name in (
        "models/actuator.xml", "models/scene.xml", "models/torque_curve.csv", "models/README.md",
        "models/assets/coil.obj", "models/py.typed", "scenario/shipped/nutation.toml",
        "plant/mujoco_rotor.py", "cli/simulate.py", "paper/rivals_ideal.json", "paper/figure8.toml",
        "py.typed",
        "viz/pages/page.css", "viz/pages/interactive.js", "viz/bench/page_head.html",
    ):  # fmt: skip
        assert f"spheretwin/{name}" in names


def test_every_source_file_is_packed(names):
    for source, place in INSTALLED_AS.items():
        for path in (ROOT / source).rglob("*.py"):
            assert str(Path("spheretwin", place, path.relative_to(ROOT / source))) in names
