"""Signals: the first requests a stop, the second ends the process, whatever code runs."""

import json
import signal

import pytest

from spheretwin.models.base.files import OPEN_FILES
from spheretwin.models.telemetry.table import read_parquet
from tests.twin.cli.calls import call, started, succeeded

# Each law says on stderr that it hangs: tests wait for that line. Only the first chunk of 1 s is finished.
LAWS = """
import ctypes
import sys

import numba
import numpy as np

from spheretwin.control.law import Law
from spheretwin.control.law_components.parameters import LawParameters

write = ctypes.CDLL(None).write
write.argtypes, write.restype = [ctypes.c_int, ctypes.c_void_p, ctypes.c_size_t], ctypes.c_ssize_t
LINE = np.frombuffer(b"it hangs\\n", dtype=np.uint8)


def compiled(t, reference, measurement, parameters, state, torque):
    for i in range(3):
        torque[i] = -0.5 * (measurement[0, i] - reference[0, i]) - 0.03 * measurement[1, i]
    if t > 1.5:
        write(2, LINE.ctypes, 9)
        while t > 1.5:
            torque[0] += 1e-9


def plain(t, reference, measurement, parameters, state, torque):
    torque[:] = 0.0
    if t > 0.005:
        print("it hangs", file=sys.stderr, flush=True)
        while True:
            pass


class Slow(LawParameters):
    def build(self, known):
        print("it hangs", file=sys.stderr, flush=True)
        while True:
            pass


compiled = numba.njit(compiled)
"""

ALWAYS = ["--plant.engine", "lagrangian", "--controller.law"]
CODES = {signal.SIGINT: 130, signal.SIGTERM: 143}


@pytest.fixture
def laws(tmp_path):
    (path := tmp_path / "laws.py").write_text(LAWS)
    return path


def line_with(process, text):
    """Read lines of stderr until one has a text."""
    for line in process.stderr:
        if text in line:
            return line
    raise AssertionError(f"{text!r} did not come, exit code {process.wait()}")


def ended(process, number):
    """Send a signal to a process that hangs, and a second one when it has said what that does."""
    with process:
        try:
            line_with(process, "it hangs")
            process.send_signal(number)
            line_with(process, "a second Ctrl-C or SIGTERM ends the process at once")
            process.send_signal(number)
            stderr = process.stderr.read()
        finally:
            process.kill()
    assert process.returncode == CODES[number]
    assert stderr.startswith(f"spheretwin: ended at once by a second signal, {signal.Signals(number).name}\n")
    return stderr.splitlines()[1:]


def test_a_compiled_law_that_never_returns_ends_by_the_second_signal(laws, tmp_path):
    telemetry, recording = tmp_path / "run.parquet", tmp_path / "run.rrd"
    outputs = ["--telemetry", telemetry, "--record", recording]
    lines = ended(
        started("simulate", "hold", "--duration", "3", *ALWAYS, f"{laws}:compiled", *outputs), signal.SIGINT
    )
    assert len(lines) == 2
    for line, target in zip(sorted(lines), (telemetry, recording), strict=True):
        assert not target.exists()
        complaint, _, command = line.partition(": spheretwin ")
        assert complaint == f"spheretwin: not complete: {target}; 1000 rows can be recovered"
        assert "recovered 1000 rows, 1.000 s of the run" in succeeded(*command.split())
    assert len(read_parquet(telemetry)[0]) == 1000


BENCH = ["bench", "hold", "--no-browser", "--port", "0"]


TWICE = pytest.mark.release(
    "a process that is interrupted twice, 2 s; a compiled law that never returns has one, too"
)


@TWICE
@pytest.mark.parametrize(
    ("command", "law", "number"),
    [
        (["simulate", "hold"], "Slow", signal.SIGINT),
        (BENCH, "Slow", signal.SIGINT),
        (["simulate", "hold", "--telemetry", "run.parquet", "--record", "run.rrd"], "plain", signal.SIGTERM),
    ],
    ids=["build", "bench", "law"],
)
def test_python_that_never_returns_ends_too_and_files_without_rows_are_not_named(
    laws, monkeypatch, command, law, number
):
    monkeypatch.chdir(laws.parent)
    assert ended(started(*command, *ALWAYS, f"{laws}:{law}"), number) == []


@TWICE
def test_rows_that_never_return_end_by_the_second_signal_and_the_study_goes_on(laws, tmp_path):
    source = tmp_path / "study.toml"
    source.write_text(
        'name = "hanging"\nscenario = "hold"\nfields = {"plant.engine" = "lagrangian"}\n'
        f'law = [{{law = "{laws}:compiled"}}]\n'
        '[[axis]]\nfield = "duration"\nkind = "values"\nvalues = [0.01, 0.02, 2.0]\n'
    )
    command = ["sweep", source, "--out", tmp_path / "out", "--threads", "2"]
    lines = ended(started(*command), signal.SIGTERM)
    assert lines == ["spheretwin: sweep: finished rows are stored; the same command continues from there"]
    stored_lines = (tmp_path / "out" / "journal.jsonl").read_bytes().splitlines()[1:]
    assert sorted(json.loads(line)[0] for line in stored_lines) == [0, 1]


def test_files_that_are_complete_are_not_named(tmp_path):
    before = list(OPEN_FILES.partial())
    outputs = ["--telemetry", tmp_path / "run.parquet", "--record", tmp_path / "run.rrd"]
    assert call("simulate", "hold", "--duration", "0.01", "--json", *outputs).code == 0
    assert list(OPEN_FILES.partial()) == before
