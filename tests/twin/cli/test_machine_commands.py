"""Verbs `machine` and `drive`: both together, files, ends and exit codes."""

import json
import os
import signal
import socket
import subprocess

import numpy as np
import pytest

from spheretwin.cli import drive, machine
from spheretwin.models.telemetry.table import read_parquet
from tests.requirements import needs_posix
from tests.twin.cli.calls import call, started
from tests.twin.machine.link.lines import MEASUREMENT, command
from tests.waiting import UNLIMITED_S

MACHINE = ["machine", "sinusoid", "--listen"]


@pytest.mark.release("two processes at the pace of the clock, 1 s; test_programs.py runs both in lockstep")
def test_both_verbs_write_their_files_in_real_time(tmp_path):
    """No number depends on the load of the computer: nothing ends the run but the end of the controller."""
    names = {name: tmp_path / name for name in ("m.parquet", "d.parquet", "d.rrd", "log.parquet")}
    flags = ["--json", "--timeout-ms", str(1000 * UNLIMITED_S)]
    files = ["--telemetry", names["d.parquet"], "--record", names["d.rrd"], "--log", names["log.parquet"]]
    own = ["udp://:0", "--idle-s", str(UNLIMITED_S), "--real-time", "--duration", "60"]
    with started(*MACHINE, *own, *flags, "--telemetry", names["m.parquet"]) as process:
        address = f"udp://:{process.stderr.readline().strip().rpartition(':')[2]}"
        arm = ["--machine", address, "--arm", "--ramp-s", "0.1", "--duration", "0.3"]
        # A rotor moves on while one of the two waits for a processor.
        arm += ["--limit-rate-rad-s", "1000", "--limit-chi2", "1e9"]
        result = call("drive", "sinusoid", *arm, *flags, *files)
        out, _ = process.communicate()
    assert result.code == 0
    ours, theirs = result.json, json.loads(out)
    assert (ours["status"], theirs["status"]) == ("completed", "interrupted")
    assert ours["link"]["jitter"]["max_ms"] >= ours["link"]["jitter"]["p50_ms"] > 0
    assert all(path.stat().st_size for path in names.values())
    rows, metadata = read_parquet(names["d.parquet"])
    assert len(rows) == 300
    assert json.loads(metadata["journal"]) == [[0, "external", f"a machine at {address}"]]
    assert np.any(rows["current_command_A"])
    _, metadata = read_parquet(names["m.parquet"])
    assert json.loads(metadata["journal"]) == [[0, "external", "a controller at udp://:0"]]


@needs_posix
def test_an_interrupted_machine_says_so(monkeypatch):
    messages = []

    def print_message(text):
        messages.append(text)
        if text.startswith("listening at udp://"):
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(machine, "print_message", print_message)
    assert call(*MACHINE, "udp://:0", "--idle-s", str(UNLIMITED_S)).code == 1
    assert messages[1:] == ["the run ended at 0.000 s of 10 s: interrupted, a stop was requested"]


def test_frames_through_a_pipe():
    """The machine reads commands from standard input, and its frames are alone on standard output."""
    frames = b"".join(
        [command(1, flags=2), *(command(i, current=0.5) for i in range(2, 12)), command(12, flags=4)]
    )
    environment = {**os.environ, "COLUMNS": "200"}
    pipe = {"stdin": subprocess.PIPE, "text": False, "env": environment}
    with started(*MACHINE, "-", "--duration", "1", **pipe) as process:
        out, err = process.communicate(frames)
    assert process.returncode == 1
    assert b"interrupted, the controller ended the run" in err
    size = MEASUREMENT.size
    answers = [MEASUREMENT.decode(out[at : at + size]) for at in range(0, len(out), size)]
    assert [answer["echo"] for answer in answers[:-1]] == list(range(1, 12))
    assert np.any(answers[-1]["angle"])  # the currents have moved the rotor


def test_a_refused_sender_and_the_peer_have_a_line_each():
    with (
        started(*MACHINE, "udp://:0", "--json", "--idle-s", str(UNLIMITED_S)) as process,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer,
    ):
        port = int(process.stderr.readline().strip().rpartition(":")[2])
        lines = []
        for end, frames in ((stranger, [b"no frame"]), (peer, [command(1, flags=2), command(2)])):
            end.connect(("127.0.0.1", port))
            for frame in frames:
                end.send(frame)
            lines.append(process.stderr.readline().strip())
        names = [f"127.0.0.1:{end.getsockname()[1]}" for end in (stranger, peer)]
        peer.send(command(3, flags=4))
        out, _ = process.communicate()
    assert lines == [f"spheretwin: refused: {names[0]}", f"spheretwin: the peer is {names[1]}"]
    assert json.loads(out)["link"]["refused_senders"] == {names[0]: 1}


def test_a_machine_that_does_not_answer_is_a_failure(monkeypatch):
    settings = drive._settings
    monkeypatch.setattr(
        drive, "_settings", lambda options: settings(options).model_copy(update={"connect_s": 0.1})
    )
    result = call("drive", "sinusoid", "--machine", "udp://127.0.0.1:9", "--arm")
    assert result.code == 1
    assert "expected a measurement within 0.1 s" in result.err
