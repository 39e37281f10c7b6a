"""Verbs `machine` and `drive`: both together, files, refusals and exit codes."""

import json
import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from spheretwin import cli
from spheretwin.models.telemetry.table import read_parquet
from tests.requirements import needs_posix
from tests.waiting import UNLIMITED_S


def machine(*flags, scenario="sinusoid", **options):
    command = [
        sys.executable,
        "-m",
        "spheretwin",
        "machine",
        scenario,
        "--listen",
        "udp://:0",
        "--idle-s",
        "600",
        *flags,
    ]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)


def port_of(process):
    return process.stderr.readline().strip().rpartition(":")[2]


@pytest.mark.release("two processes at the pace of the clock, 1 s; test_programs.py runs both in lockstep")
def test_both_verbs_write_their_files_in_real_time(tmp_path, capsys):
    """No number depends on the load of the computer: the timeouts are long, and only files are compared."""
    names = {name: tmp_path / name for name in ("m.parquet", "d.parquet", "d.rrd", "log.parquet")}
    flags = ["--duration", "0.3", "--json", "--timeout-ms", str(1000 * UNLIMITED_S)]
    with machine("--real-time", "--telemetry", str(names["m.parquet"]), *flags) as process:
        files = [
            text
            for flag, name in (("telemetry", "d.parquet"), ("record", "d.rrd"), ("log", "log.parquet"))
            for text in (f"--{flag}", str(names[name]))
        ]
        address = f"udp://:{port_of(process)}"
        code = cli.main(
            ["drive", "sinusoid", "--machine", address, "--arm", "--ramp-s", "0.1", *flags, *files]
        )
        out, _ = process.communicate()
    assert code in (0, 1)  # 1: the clock of the machine had run 0.3 s before that of the controller
    ours, theirs = json.loads(capsys.readouterr().out), json.loads(out)
    assert {ours["status"], theirs["status"]} <= {"completed", "interrupted"}
    assert ours["link"]["jitter"]["max_ms"] >= ours["link"]["jitter"]["p50_ms"] > 0
    assert theirs["link"]["jitter"]["max_ms"] > 0
    assert all(path.stat().st_size for path in names.values())
    rows, metadata = read_parquet(names["d.parquet"])
    assert len(rows) > 100
    assert json.loads(metadata["journal"]) == [[0, "external", f"a machine at {address}"]]
    truth, metadata = read_parquet(names["m.parquet"])
    assert json.loads(metadata["journal"]) == [[0, "external", "a controller at udp://:0"]]
    assert np.any(truth["current_A"])


@needs_posix
def test_an_interrupted_machine_says_so():
    with machine() as process:
        port_of(process)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate()
    assert process.returncode == 1
    assert "interrupted, a stop was requested" in err


def test_frames_through_a_pipe(tmp_path):
    """The machine reads commands from standard input, and its frames are alone on standard output."""
    from tests.twin.machine.link.lines import MEASUREMENT, command

    frames = b"".join(
        [command(1, flags=2), *(command(i, current=0.5) for i in range(2, 12)), command(12, flags=4)]
    )
    done = subprocess.run(
        [sys.executable, "-m", "spheretwin", "machine", "sinusoid", "--listen", "-", "--duration", "1"],
        input=frames, capture_output=True, check=False, env={**os.environ, "COLUMNS": "200"},
    )  # fmt: skip
    assert done.returncode == 1
    assert b"interrupted, the controller ended the run" in done.stderr
    size = MEASUREMENT.size
    answers = [MEASUREMENT.decode(done.stdout[at : at + size]) for at in range(0, len(done.stdout), size)]
    assert [answer["echo"] for answer in answers[:-1]] == list(range(1, 12))
    assert np.any(answers[-1]["angle"])  # the currents have moved the rotor


def test_a_machine_that_does_not_answer_is_a_failure(capsys, monkeypatch):
    from spheretwin.cli import drive

    settings = drive._settings
    monkeypatch.setattr(
        drive, "_settings", lambda options: settings(options).model_copy(update={"connect_s": 0.1})
    )
    assert cli.main(["drive", "sinusoid", "--machine", "udp://127.0.0.1:9", "--arm"]) == 1
    assert "expected a measurement within 0.1 s" in capsys.readouterr().err
