"""The verb `bench`: where it is served, what it refuses, and how it ends."""

import os
import re
import signal
import socket
import subprocess
import sys
import urllib.request
from types import SimpleNamespace

import pytest

from spheretwin import cli
from spheretwin.bench.operators import Operators
from spheretwin.cli import bench
from spheretwin.viz.bench.page import Page
from tests.waiting import PATIENCE_S

COMMAND = (sys.executable, "-m", "spheretwin", "bench", "hold", "--plant.engine", "lagrangian")


def test_a_port_in_use_is_told_in_one_line(capsys):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        code = cli.main(
            ["bench", "hold", "--plant.engine", "lagrangian", "--no-browser", "--port", str(port)]
        )
    assert code == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"spheretwin: bench: expected a free port, received {port}")
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--port", "70000"], "expected a port from 0 to 65535, received 70000"),
        (["--plant.step-s", "-1"], "plant.step_s: expected"),
        (["--record", "/no/such/folder/a.rrd"], "/no/such/folder"),
    ],
)
def test_bad_input_is_told_before_anything_is_served(arguments, told, capsys):
    assert cli.main(["bench", "hold", "--no-browser", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert told in err
    assert err.count("\n") == 1


def test_ctrl_c_ends_it_and_what_was_recorded_is_kept(tmp_path):
    recording = tmp_path / "bench.rrd"
    with subprocess.Popen(
        [*COMMAND, "--no-browser", "--port", "0", "--record", str(recording)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONWARNINGS": "error"},
    ) as process:
        first = process.stdout.readline()
        address = first.split()[1]
        assert address.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(address) as answer:  # it is said once the page answers
            assert answer.status == 200
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE_S)
    # On a busy machine the end takes a while, and a line says what a second Ctrl-C would do.
    lines = [line for line in err.splitlines() if "a second Ctrl-C" not in line]
    assert (process.returncode, lines) == (0, ["bench: preparing hold"])
    assert out.split() == ["written", str(recording)]
    assert recording.stat().st_size > 0


def test_without_viser_it_says_what_brings_it(monkeypatch, capsys):
    monkeypatch.setattr("spheretwin.cli.bench.find_spec", lambda name: None)
    assert cli.main(["bench", "hold", "--no-browser"]) == 2
    assert "spheretwin[bench]" in capsys.readouterr().err


@pytest.mark.parametrize("flags", [[], ["--no-browser", "--hold-after", "7"]], ids=["browser", "none"])
def test_a_browser_is_opened_at_the_printed_address_unless_it_is_not_to(capsys, monkeypatch, flags):
    opened, silences = [], []

    def operators(*silence_s):
        silences.append(silence_s)
        return Operators(*silence_s)

    monkeypatch.setattr(bench, "Operators", operators)
    monkeypatch.setattr(Page, "show", lambda page, ended: None)
    monkeypatch.setattr(bench.webbrowser, "open", opened.append)
    assert cli.main(["bench", *COMMAND[4:], "--port", "0", *flags]) == cli.DONE
    out, err = capsys.readouterr()
    address = re.fullmatch(r"bench: (http://127\.0\.0\.1:\d+) \(Ctrl-C ends it\)\n", out)[1]
    assert opened == ([] if flags else [address])
    assert silences == [(7.0 if flags else 2.0, 10.0)]
    assert err == "bench: preparing hold\n"


@pytest.mark.parametrize(("recording", "line"), [((), ""), (("c", "d"), "spheretwin: not completed: c, d\n")])
def test_recordings_that_are_not_complete_fail_the_bench(capsys, recording, line):
    state = SimpleNamespace(completed_files=("a", "b"), recording=recording)
    assert bench._report(SimpleNamespace(state=lambda: state)) == (not recording)
    assert capsys.readouterr() == ("written  a\nwritten  b\n", line)
