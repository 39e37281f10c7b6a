"""Damage that crashes Rerun's reader only ends a separate process, and is reported on one line."""

import os
import random
import subprocess
import sys

import pytest

from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.viz import rerun_internals
from tests.viz.recording.recordings import recorded

FILES = 24


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


READ = """
import sys
from spheretwin import cli
for path in sys.argv[1:]:
    print(cli.main(["review", path, "--json"]), path, file=sys.stderr)
"""


@pytest.mark.release("reads 24 files for 2.3 s; test_a_reader_that_dies_is_damage has the end of a reader")
def test_no_damage_ends_the_process_or_says_more_than_a_line(tmp_path):
    """Bits, bytes, blocks, wherever they are; a damaged number may stay a number."""
    whole = tmp_path / "whole.rrd"
    recorded(whole, duration=0.3)
    content, draws, paths = whole.read_bytes(), random.Random(0), []
    for number in range(FILES):
        damaged = bytearray(content)
        at = draws.randrange(12, len(damaged) - 5000)
        size = (1, 1, 2000, 4)[number % 4]
        damaged[at : at + size] = draws.randbytes(size) if number % 4 else bytes([damaged[at] ^ 8])
        paths.append(tmp_path / f"{number}.rrd")
        paths[-1].write_bytes(damaged)
    done = subprocess.run(
        [sys.executable, "-c", READ, *map(str, paths)], capture_output=True, text=True,
        env={**os.environ, "RUST_BACKTRACE": "0"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    lines = done.stderr.splitlines()
    messages = [[line for line in lines if str(path) in line] for path in paths]
    for of_file in messages:
        assert (of_file[-1].split()[0], len(of_file)) in {("0", 1), ("2", 2)}
    assert sum(map(len, messages)) == len(lines)
