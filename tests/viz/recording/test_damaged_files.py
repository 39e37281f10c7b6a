"""Damage that crashes Rerun's reader only ends a separate process, and is reported on one line."""

import sys

import pytest

from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.viz import rerun_internals


def program(folder, text):
    path = folder / "rerun"
    path.write_text(f"#!{sys.executable}\nimport os, signal\n{text}\n", encoding="utf-8")
    path.chmod(0o755)
    return path


@pytest.mark.parametrize("end", ["os.kill(os.getpid(), signal.SIGABRT)", "os._exit(102)"])
def test_a_reader_that_dies_is_damage(tmp_path, monkeypatch, end):
    monkeypatch.setattr(rerun_internals, "PROGRAM", program(tmp_path, end))
    with pytest.raises(InputError, match=r"recording run\.rrd: expected one of a run, .*so damaged"):
        rerun_internals.check_readable(tmp_path / "copy.rrd", "run.rrd")


@pytest.mark.parametrize("end", ["os._exit(0)", "os._exit(1)"])
def test_errors_that_the_reader_survives_are_left_to_it(tmp_path, monkeypatch, end):
    monkeypatch.setattr(rerun_internals, "PROGRAM", program(tmp_path, end))
    rerun_internals.check_readable(tmp_path / "run.rrd", "run.rrd")


def test_a_missing_reader_is_reported(tmp_path, monkeypatch):
    monkeypatch.setattr(rerun_internals, "PROGRAM", tmp_path / "none")
    with pytest.raises(SpheretwinError, match="expected Rerun at"):
        rerun_internals.check_readable(tmp_path / "run.rrd", "run.rrd")
