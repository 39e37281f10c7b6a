"""A run's own file names its model and curves so that it can be run again from anywhere, or says why not."""

import json
import os
import shutil

import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.records import replay
from spheretwin.records.outputs import Outputs
from spheretwin.session import Session
from spheretwin.simulation import follow

PATHS = {"plant.mjcf": "m.xml", "plant.torque_curve": "p.csv", "nominal.torque_curve": "n.csv"}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working folder, with a model and two curves of the user's."""
    (there := tmp_path / "there").mkdir()
    shutil.copytree(actuators.FOLDER / "assets", there / "assets")
    shutil.copy(actuators.MJCF_PATH, there / "m.xml")
    for name in ("p.csv", "n.csv", "later.csv"):
        shutil.copy(actuators.TORQUE_CURVE_PATH, there / name)
    monkeypatch.chdir(there)
    return there


def written(path, changes=(), meanwhile=lambda: None):
    """A run of 20 ticks, with changes after the tenth, as the command writes it."""
    session = Session(scenarios.load("hold", {"duration": 0.02, "controller.law": "pd", **PATHS}))
    files = Outputs(session, None, path, live=False)
    follow(session, 10, files.sinks)
    for name, value in changes:
        session.set(name, value)
    follow(session, 20, files.sinks)
    meanwhile()
    assert files.close() == []
    return path


def rewritten(path, change):
    """Replace a part of the metadata of a run."""
    table, metadata = read_parquet(path)
    table.write_parquet(path, change(metadata))
    return path


CHANGES = {
    "none": [],
    "fields": [("nominal.torque_curve", "later.csv"), ("plant.torque_curve", "later.csv")],
    "section": [("nominal", {"torque_curve": "later.csv"})],
}


@pytest.mark.parametrize("changes", CHANGES.values(), ids=CHANGES)
def test_a_run_replays_from_another_folder(folder, changes, monkeypatch):
    first = written(folder / "a.parquet", changes)
    (elsewhere := folder.parent / "elsewhere").mkdir()
    monkeypatch.chdir(elsewhere)
    assert cli.main(["simulate", "--replay", str(first), "--telemetry", "b.parquet", "--json"]) == 0
    assert (elsewhere / "b.parquet").read_bytes() == first.read_bytes()
    fields = json.loads(read_parquet(first)[1]["scenario"])
    for dotted, name in PATHS.items():
        section, field = dotted.split(".")
        assert fields[section][field] == str(folder / name)


def add_a_line(path):
    path.write_bytes(path.read_bytes() + b"\n")


@pytest.mark.parametrize("edit", [add_a_line, os.remove], ids=["edited", "removed"])
@pytest.mark.parametrize("name", [*PATHS.values(), "later.csv"])
def test_another_file_than_the_run_s_is_refused_on_one_line(folder, name, edit):
    path = written(folder / "a.parquet", [("nominal.torque_curve", "later.csv")])
    replay.read(path)
    edit(folder / name)
    with pytest.raises(InputError, match="as it was at the start of the run") as refusal:
        replay.read(path)
    assert str(folder / name) in f"{refusal.value}"
    assert "\n" not in f"{refusal.value}"


def test_an_edited_mesh_is_refused(folder):
    path = written(folder / "a.parquet")
    add_a_line(folder / "assets" / "shaft.obj")
    with pytest.raises(InputError, match=r"plant\.mjcf .*m\.xml as it was"):
        replay.read(path)


@pytest.mark.parametrize("edit", [add_a_line, os.remove], ids=["edited", "removed"])
def test_a_file_that_changes_under_a_run_is_told_as_the_run_had_it(folder, edit):
    before = (folder / "p.csv").read_bytes()
    path = written(folder / "a.parquet", meanwhile=lambda: edit(folder / "p.csv"))
    with pytest.raises(InputError, match="as it was"):
        replay.read(path)
    (folder / "p.csv").write_bytes(before)
    assert replay.read(path).ticks == 20


def test_a_file_of_a_version_that_told_no_files_replays(folder):
    path = written(folder / "old.parquet")
    rewritten(path, lambda known: {name: value for name, value in known.items() if name != "files"})
    assert replay.read(path).ticks == 20


def test_a_file_that_the_run_could_not_read_and_that_exists_now_is_refused(folder):
    missing = str(folder / "p.csv")
    path = rewritten(
        written(folder / "a.parquet"),
        lambda known: known | {"files": json.dumps(json.loads(known["files"]) | {missing: None})},
    )
    with pytest.raises(InputError, match=r"plant\.torque_curve .*p\.csv as it was at the start of the run"):
        replay.read(path)


def test_a_file_of_the_same_name_beside_the_telemetry_does_not_replace_another(folder):
    (elsewhere := folder.parent / "elsewhere").mkdir()
    path = written(elsewhere / "a.parquet")
    shutil.move(folder / "p.csv", elsewhere / "p.csv")
    replay.read(path)
    add_a_line(elsewhere / "p.csv")
    with pytest.raises(InputError, match=f"plant.torque_curve {folder / 'p.csv'} as it was"):
        replay.read(path)
