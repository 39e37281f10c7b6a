"""Damaged files of a run: a flipped bit is reported on one line, or it changes nothing that is read."""

import json
import random
import runpy
from pathlib import Path

import numpy as np
import pytest

from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.file import TelemetryFile
from spheretwin.twin import cli
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.commands.outputs import Outputs
from spheretwin.twin.records import replay
from spheretwin.twin.records.facts import record_of
from spheretwin.twin.review import leavings
from spheretwin.twin.review.figures import figures
from spheretwin.twin.review.run import read
from spheretwin.twin.session import Session
from spheretwin.twin.simulation import follow

# By its path: the tests are no package.
shared = runpy.run_path(str(Path(__file__).with_name("runs.py")))
PLANT, WITH_EVENTS, written = shared["PLANT"], shared["WITH_EVENTS"], shared["written"]

# The path of a file below the folder of a test, and a sentence.
LONGEST_LINE = 600


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Telemetry and recording of a run in which much happens."""
    return written(tmp_path_factory.mktemp("files"), **WITH_EVENTS)


@pytest.fixture(scope="module")
def decimated(tmp_path_factory):
    """Recording that keeps 60 rows a second."""
    path = tmp_path_factory.mktemp("decimated") / "run.rrd"
    with Session(scenarios.load("hold", WITH_EVENTS)) as session:
        outputs = Outputs(session, path, None, live=False, record_rate_Hz=60.0)
        follow(session, session.scenario.ticks, outputs.sinks)
        assert outputs.close() == []
    return path


def flips(content, count, seed=0):
    """Places of single bits, and the content with each flipped."""
    draws = random.Random(seed)
    for bit in (draws.randrange(8 * len(content)) for _ in range(count)):
        damaged = bytearray(content)
        damaged[bit // 8] ^= 1 << bit % 8
        yield bit, bytes(damaged)


def refused(printed, path):
    """True if what was printed is one line of bounded length about a file."""
    (line,) = printed.err.splitlines()
    assert printed.out == ""
    assert line.startswith("spheretwin: ")
    assert str(path) in line
    assert len(line) <= LONGEST_LINE, line
    return True


def same_run(run, other):
    told = [json.dumps({**figures(each), "path": ""}) for each in (run, other)]
    same_table = run.table.signals == other.table.signals and np.array_equal(
        run.table.values.view(np.uint64), other.table.values.view(np.uint64)
    )
    return same_table and told[0] == told[1] and run.metadata == other.metadata


def passed(path, content, whole, capfd):
    """Review of a file with some content: True if it is refused, or the same as the whole run."""
    path.write_bytes(content)
    if cli.main(["review", str(path), "--json"]) == cli.DONE:
        printed = capfd.readouterr()
        return printed.err == "" and same_run(read(path), whole)
    return refused(capfd.readouterr(), path)


@pytest.mark.parametrize(("kind", "count"), [(0, 120), (1, 35)], ids=["telemetry", "recording"])
def test_a_flipped_bit_is_reported_or_changes_nothing(files, tmp_path, capfd, kind, count):
    whole, path = read(files[kind]), tmp_path / files[kind].name
    for bit, content in flips(files[kind].read_bytes(), count):
        assert passed(path, content, whole, capfd), f"bit {bit}"
