"""Files of a bench: below its folder, regular, never overwritten; what a folder offers is not run."""

import os
import threading

import pytest

from spheretwin import scenario as scenarios
from spheretwin.bench import Bench
from spheretwin.bench.folder import Folder, FolderFiles
from spheretwin.models.base.errors import InputError
from tests.twin.bench.cases import FREE, begun, done, said

LAW = """
def still(t, reference, measurement, parameters, state, torque):
    torque[:] = 0.0
"""


@pytest.fixture
def folder(tmp_path):
    (inside := tmp_path / "inside").mkdir()
    for place in (tmp_path, inside):
        (place / "law.py").write_text(LAW)
    (inside / "link.py").symlink_to(tmp_path / "law.py")
    os.mkfifo(inside / "pipe.py")
    (inside / "folder.py").mkdir()
    return inside


@pytest.fixture
def of_folder(folder):
    return Folder(folder, scenarios.load("hold"))


OUTSIDE = ["../law.py", "link.py", "~/law.py", "/etc/passwd", "a/../../law.py", "\0", "/dev/zero"]


@pytest.mark.parametrize("name", OUTSIDE)
def test_a_file_beyond_the_folder_is_neither_read_nor_written(of_folder, name):
    for use in (of_folder.readable, of_folder.claim):
        with pytest.raises(InputError, match=r"^bench: expected a (file below|path)"):
            use(name)


@pytest.mark.parametrize("name", ["pipe.py", "folder.py"])
def test_a_pipe_and_a_folder_are_refused_without_being_opened(of_folder, name):
    with pytest.raises(InputError, match="expected a regular file"):
        of_folder.readable(name)
    with pytest.raises(InputError, match=r"expected a (regular file|file name)"):
        of_folder.claim(name)


def test_a_device_is_refused_where_files_may_be_anywhere(folder):
    with pytest.raises(InputError, match="expected a regular file"):
        Folder(None, scenarios.load("hold")).readable("/dev/zero")
    assert Folder(None, scenarios.load("hold")).readable(str(folder / "link.py")).name == "law.py"


def test_paths_are_those_of_the_folder(of_folder, folder):
    assert of_folder.readable("law.py") == folder / "law.py"
    assert of_folder.value("controller.law", "law.py:still") == f"{folder / 'law.py'}:still"
    assert of_folder.value("controller.law", "pd") == "pd"
    with pytest.raises(InputError, match="expected a file below"):
        of_folder.value("controller.law", "../law.py:still")
    with pytest.raises(InputError, match="expected a file below"):
        of_folder.value("trajectory", {"shape": "waypoints", "file": "../law.py"})


def test_the_files_of_the_first_scenario_remain_readable(folder, tmp_path):
    scenario = scenarios.load("hold", {"controller.law": f"{tmp_path / 'law.py'}:still"})
    assert Folder(folder, scenario).readable("../law.py") == tmp_path / "law.py"
    given = [tmp_path / "run.rrd"]
    assert Folder(folder, scenario, given).claim("../run.rrd") == given


def test_a_scenario_that_names_a_file_beyond_the_folder_is_refused(of_folder, folder):
    (folder / "a.toml").write_text(
        'name = "a"\n[controller]\nlaw = "../law.py:still"\n[trajectory]\nshape="hold"'
    )
    with pytest.raises(InputError, match="expected a file below"):
        of_folder.source("a.toml", {})
    (folder / "b.toml").write_text(
        'name = "b"\n[controller]\nlaw = "law.py:still"\n[trajectory]\nshape="hold"'
    )
    assert of_folder.source("b.toml", {})[0] == str(folder / "b.toml")
    assert of_folder.source("hold", {"plant.payload_kg": 0.1}) == ("hold", {"plant.payload_kg": 0.1})


def test_names_are_numbered_together_and_nothing_is_overwritten(of_folder, folder):
    (folder / "run.parquet").write_text("old")
    assert of_folder.claim("run.rrd", "run.parquet") == [folder / "run-2.rrd", folder / "run-2.parquet"]
    assert of_folder.claim("run.rrd", "run.parquet") == [folder / "run-3.rrd", folder / "run-3.parquet"]
    assert of_folder.claim("run.rrd") == [folder / "run.rrd"]
    (folder / "gone.rrd").symlink_to(folder / "nowhere.rrd")
    assert of_folder.claim("gone.rrd") == [folder / "nowhere.rrd"]
    assert (folder / "run.parquet").read_text() == "old"


def test_two_benches_never_claim_the_same_name(folder):
    """A recording is moved to its name at its end: the name must be taken at its start."""
    claimed, folders = [], [Folder(folder, scenarios.load("hold")) for _ in range(8)]
    threads = [threading.Thread(target=lambda of=of: claimed.extend(of.claim("a.rrd"))) for of in folders]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(claimed)) == 8


def test_a_second_recording_and_a_second_scenario_get_numbers(tmp_path):
    scenario = scenarios.load("sinusoid", FREE)
    with Bench(scenario, folder=Folder(tmp_path, scenario)) as bench:
        done(bench, "start")
        for _ in range(2):
            done(bench, "record", telemetry="run.parquet")
            bench.advance(20)
            done(bench, "keep")
            done(bench, "save", file="mine.toml")
            assert bench.state().note == f"written {bench.state().completed_files[-1]}"
    names = [tmp_path / f"{stem}{number}.{end}" for number in ("", "-2") for stem, end in FILES]
    assert sorted(bench.state().completed_files) == sorted(map(str, names))
    assert sorted(tmp_path.iterdir()) == sorted(names)
    assert all(path.stat().st_size for path in names)


FILES = (("run", "parquet"), ("mine", "toml"))


def test_no_empty_file_is_left_of_what_was_refused(tmp_path):
    with begun() as bench:
        for recording, refused in ((tmp_path / "a", "a separate path"), (tmp_path / "no" / "b", "writable")):
            paths = {"recording": str(recording), "telemetry": str(tmp_path / "a")}
            assert refused in said(bench, "record", **paths)
        for verb, names, end in (
            ("record", {"telemetry": "run.csv"}, ".parquet"),
            ("record", {"recording": "run.mcap"}, ".rrd"),
            ("save", {"file": "mine.json"}, ".toml"),
        ):
            paths = {name: str(tmp_path / file) for name, file in names.items()}
            assert f"a name that ends in {end}" in said(bench, verb, **paths)
        done(bench, "record", telemetry=str(tmp_path / "run.parquet"))
        assert "expected keep before" in said(bench, "record", recording=str(tmp_path / "b.rrd"))
        bench.advance(10)
    assert [path.name for path in tmp_path.iterdir()] == ["run.parquet"]


def test_scenarios_are_toml_files_with_a_section_of_a_scenario(tmp_path):
    (tmp_path / "mine.toml").write_text('[trajectory]\nshape = "hold"\n')
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "x"\n')
    (tmp_path / "broken.toml").write_text("[")
    os.mkfifo(tmp_path / "pipe.toml")  # opening it would wait for ever
    files = FolderFiles(tmp_path)
    assert files.scenarios() == ["mine.toml"]
    (tmp_path / "saved.toml").write_text("[plant]\n")
    assert files.scenarios() == ["mine.toml", "saved.toml"]
    (tmp_path / "mine.toml").unlink()
    assert files.scenarios() == ["saved.toml"]


def test_laws_are_classes_or_steps_of_files_that_are_not_run(tmp_path):
    (tmp_path / "law.py").write_text(
        "raise SystemExit\nclass Mine(LawParameters): pass\nclass Other: pass\n"
        "def step(t, reference, measurement, parameters, state, torque): pass\n"
    )
    (tmp_path / "step.py").write_text(
        "def helper(x): pass\ndef plain(t, reference, measurement, parameters, state, torque): pass\n"
    )
    (tmp_path / "broken.py").write_text("def (")
    assert FolderFiles(tmp_path).laws() == ["law.py:Mine", "step.py:plain"]


def test_a_changed_file_is_read_again(tmp_path):
    law, files = tmp_path / "law.py", FolderFiles(tmp_path)
    law.write_text("class A(LawParameters): pass\n")
    assert files.laws() == ["law.py:A"]
    law.write_text("class B(LawParameters): pass\n")
    os.utime(law, (1, 1))
    assert files.laws() == ["law.py:B"]


def test_runs_are_telemetry_and_recordings_the_newest_first(tmp_path):
    for age, name in enumerate(("old.parquet", "new.rrd", "notes.txt")):
        (tmp_path / name).touch()
        os.utime(tmp_path / name, (100 + age, 100 + age))
    assert FolderFiles(tmp_path).runs() == ["new.rrd", "old.parquet"]
