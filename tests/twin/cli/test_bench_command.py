"""The verb `bench`: where it is served, what it refuses, and how it ends."""

import os
import signal
import socket
import subprocess
import sys
import urllib.request

import pytest

from spheretwin import cli
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
