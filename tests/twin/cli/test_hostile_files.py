"""Files that no verb can use: pipes, devices, folders, random bytes. One line each, at once."""

import os
import random
import signal

import pytest

from tests.twin.cli.calls import refusal

CALLS = {
    "scenario.toml": ["simulate", "FILE"],
    "law.py": ["simulate", "hold", "--controller.law", "FILE:law"],
    "metric.py": ["simulate", "hold", "--metric", "FILE:metric"],
    "model.xml": ["simulate", "hold", "--plant.mjcf", "FILE"],
    "curve.csv": ["simulate", "hold", "--plant.torque_curve", "FILE"],
    "waypoints.csv": ["simulate", "hold", "--trajectory.shape", "waypoints", "--trajectory.file", "FILE"],
    "currents.csv": ["simulate", "hold", "--manual.file", "FILE"],
    "twin.toml": ["simulate", "hold", "--twin", "FILE"],
    "run.parquet": ["simulate", "--replay", "FILE"],
    "log.csv": ["log", "check", "FILE"],
    "log.parquet": ["log", "check", "FILE"],
    "log.mcap": ["log", "check", "FILE"],
    "map.toml": ["log", "check", "missing.csv", "--columns", "FILE"],
    "frame.toml": ["watch", "-", "--frame", "FILE"],
    "study.toml": ["sweep", "FILE"],
    "samples.csv": ["magnetics", "curve", "--csv", "FILE"],
    "other.parquet": ["review", "FILE"],
    "other.rrd": ["review", "FILE"],
    "part.parquet": ["recover", "FILE", "--out", "whole.parquet"],
}


def make(path, kind):
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "folder":
        path.mkdir()
    else:
        path.write_bytes(random.Random(f"{path.name} {kind}").randbytes(2000))


@pytest.fixture
def alarm():
    """A call that waits for bytes ends with an error, not with the tests."""

    def end(number, frame):
        raise AssertionError("the call waits for a file without an end")

    before = signal.signal(signal.SIGALRM, end)
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.usefixtures("alarm")
@pytest.mark.parametrize("kind", ["pipe", "device", "folder", "random"])
@pytest.mark.parametrize("name", CALLS)
def test_a_file_that_cannot_be_read_is_refused_in_one_line(name, kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    make(tmp_path / name, kind)
    message = refusal(*(word.replace("FILE", name) for word in CALLS[name]))
    if kind in ("pipe", "device"):
        assert "not a regular file" in message
    assert os.listdir(tmp_path) == [name]
