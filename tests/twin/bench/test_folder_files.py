"""Files that a page offers: scenarios, laws and runs of a folder, found without running them."""

import os

from spheretwin.bench.folder import FolderFiles


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
