"""Without Rerun everything but recordings works, and these name the extra in one line."""

import json
import subprocess
import sys
from importlib.util import find_spec

import pytest

import spheretwin as st
from spheretwin import cli
from spheretwin.models.base import extras

COMMANDS = (
    ["simulate", "hold", "--record", "run.rrd"],
    ["simulate", "hold", "--live"],
    ["review", "run.rrd"],
    ["recover", "run.rrd", "--out", "whole.rrd"],
    ["review", "run.parquet", "other.parquet", "--merge", "both.rrd"],
    ["shadow", "log.csv", "--record", "run.rrd"],
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Folder with telemetry of two runs, and the first bytes of a recording."""
    folder = tmp_path_factory.mktemp("runs")
    run = st.simulate("hold", {"duration": 0.01})
    run.save(folder / "run.parquet")
    run.save(folder / "other.parquet")
    run.save(folder / "whole.rrd")
    (folder / "run.rrd").write_bytes((folder / "whole.rrd").read_bytes()[:2000])
    return folder


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_commands_with_recordings_name_the_extra_in_one_line(command, folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    monkeypatch.setattr(extras, "find_spec", lambda name: None if name == "rerun" else find_spec(name))
    assert cli.main(command) == cli.BAD_INPUT
    line = capsys.readouterr().err.splitlines()[-1]
    assert "expected rerun-sdk for recordings, which the extra record installs: " in line


BLOCKED = """
import importlib.abc, json, pkgutil, sys

class Blocked(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("rerun", "rerun_cli", "rerun_bindings"):
            raise ModuleNotFoundError(name=name)

sys.meta_path.insert(0, Blocked())
import spheretwin.viz
need = []
modules = [
    module
    for package in (spheretwin, spheretwin.viz)
    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
]
for module in modules:
    try:
        if not module.name.endswith("__main__"):
            __import__(module.name)
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0].startswith("rerun"):
            need.append(module.name)
from spheretwin import cli
status = cli.main(["simulate", "hold", "--duration", "0.01", "--telemetry", "own.parquet", "--json"])
print(json.dumps([need, status, cli.main(["review", "own.parquet"])]), file=sys.stderr)
"""

RECORDINGS = ("recording.", "layout.", "comparison.", "scene.", "rerun_internals")


def test_modules_that_need_rerun_are_those_of_recordings_and_a_run_is_made_and_reviewed(tmp_path):
    process = subprocess.run(
        [sys.executable, "-c", BLOCKED], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    need, *statuses = json.loads(process.stderr.splitlines()[-1])
    assert statuses == [cli.DONE, cli.DONE]
    assert need
    assert {
        name for name in need if not name.startswith(tuple(f"spheretwin.viz.{part}" for part in RECORDINGS))
    } == set()
    for name in ("comparison.runs", "layout.extents", "layout.view", "scene.solids", "scene.places"):
        assert f"spheretwin.viz.{name}" not in need
