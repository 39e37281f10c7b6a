"""Functions out of a file of the user's: loaded as the file is now, or refused on one line that says why."""

import os
import time

import pytest

from spheretwin.models.base.user_code import load_function, short_names


@pytest.fixture
def file(tmp_path):
    (path := tmp_path / "mine.py").write_text("LIMIT = 2\n\n\ndef double(x):\n    return LIMIT * x\n")
    return path


def test_a_path_from_home_is_found(file, monkeypatch):
    monkeypatch.setenv("HOME", str(file.parent))
    monkeypatch.setenv("USERPROFILE", str(file.parent))
    assert load_function("~/mine.py:double", "law")(1) == 2


def test_short_names_have_the_file_alone_and_folders_only_where_two_files_share_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    absolute = f"{tmp_path}/laws/mine.py:Mine"
    assert short_names(["pd", "./laws/mine.py:Mine", absolute]) == ["pd", "mine.py:Mine", "mine.py:Mine"]
    assert short_names([absolute, "laws/mine.py:Other"]) == ["mine.py:Mine", "mine.py:Other"]
    assert short_names([absolute, "old/laws/mine.py:Mine", "last/mine.py:Mine", "b/other.py:Mine"]) == [
        f"{tmp_path.name}/laws/mine.py:Mine",
        "old/laws/mine.py:Mine",
        "last/mine.py:Mine",
        "other.py:Mine",
    ]


def test_an_edit_within_the_second_is_seen_and_nothing_is_left_beside_the_file(file):
    assert load_function(f"{file}:double", "law")(4) == 8
    moment = time.time()
    file.write_text(file.read_text().replace("2", "3"))  # as long as before
    os.utime(file, (moment, moment))
    assert load_function(f"{file}:double", "law")(4) == 12
    assert os.listdir(file.parent) == ["mine.py"]


def test_a_dataclass_of_the_file_finds_its_module(tmp_path):
    text = "from __future__ import annotations\nfrom dataclasses import dataclass\n"
    text += "@dataclass\nclass Pair:\n    a: int\n    b: int = 2\n"
    (path := tmp_path / "pairs.py").write_text(text)
    assert load_function(f"{path}:Pair", "law")(1).b == 2


def test_what_a_file_prints_is_kept_off_stdout(tmp_path, capsys):
    (path := tmp_path / "loud.py").write_text("print('loaded')\ndef f(): pass")
    load_function(f"{path}:f", "law")
    assert capsys.readouterr() == ("", "loaded\n")


def test_ctrl_c_is_not_taken_for_a_fault_of_the_file(tmp_path):
    (path := tmp_path / "mine.py").write_text("raise KeyboardInterrupt")
    with pytest.raises(KeyboardInterrupt):
        load_function(f"{path}:f", "law")
