"""Files of recordings: what remains if one cannot be made, written or named; links and meshes."""

import json
import os
import shutil
import subprocess
import sys
from unittest.mock import Mock

import numpy as np
import pytest

from spheretwin.analysis.recorded_run import read
from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.telemetry.signals import width
from spheretwin.models.telemetry.table import Table
from spheretwin.simulation import follow
from spheretwin.viz.recording import recorder as recording
from spheretwin.viz.recording.stream import PENDING_CHUNKS
from tests.viz.recording.recordings import opened, recorded, telemetry_of


def test_unwritable_path_is_bad_input(tmp_path):
    with pytest.raises(InputError, match="writable"):
        opened(tmp_path / "missing" / "run.rrd")


def test_a_fault_while_recording_keeps_no_run_waiting_and_is_raised(tmp_path):
    session, recorder = opened(tmp_path / "run.rrd")
    for _ in range(3 * PENDING_CHUNKS):
        recorder.write(Table(session.signals, np.full((2, width(session.signals)), np.nan)))
    with pytest.raises(SpheretwinError, match=r"recording: .*run\.rrd could not be completed") as raised:
        recorder.close()
    (left_over,) = os.listdir(tmp_path)
    assert f"{raised.value}".endswith(left_over)


def test_a_folder_at_the_path_is_reported_with_the_place_of_the_recording(tmp_path):
    session, recorder = opened(tmp_path / "run.rrd")
    follow(session, session.scenario.ticks, [recorder])
    (tmp_path / "run.rrd").mkdir()
    with pytest.raises(SpheretwinError, match=r"run\.rrd could not be written, ") as raised:
        recorder.close()
    (left_over,) = tmp_path.glob(".run.rrd.*.part")
    assert f"{raised.value}".endswith(f"; the recording is in {left_over}")
    assert len(telemetry_of(left_over, "q_rad")[0]) == 100


def test_a_partial_recording_has_every_row_that_was_written(tmp_path):
    session, recorder = opened(tmp_path / "run.rrd")
    recorder.write(session.advance(37))
    part = recorder.partial()
    (copy := tmp_path / "copy.rrd").write_bytes(part.path.read_bytes())
    recorder.close()
    np.testing.assert_allclose(read(copy).table["t_s"], 1e-3 * np.arange(37), rtol=1e-12)


def test_closing_twice_is_closing_once(tmp_path):
    session, recorder = opened(tmp_path / "run.rrd")
    with recorder:
        follow(session, session.scenario.ticks, [recorder])
        recorder.close()
    assert os.listdir(tmp_path) == ["run.rrd"]


def test_where_a_pipe_has_no_path_rerun_writes_the_file(tmp_path, monkeypatch):
    monkeypatch.setattr(recording, "PIPE_PATHS", tmp_path / "none")
    recorded(path := tmp_path / "run.rrd")
    assert len(telemetry_of(path, "q_rad")[0]) == 100
    assert os.listdir(tmp_path) == ["run.rrd"]


def test_a_file_that_cannot_be_opened_again_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "pipe", Mock(side_effect=OSError(24, "Too many open files")))
    with pytest.raises(InputError, match="Too many open files"):
        opened(tmp_path / "run.rrd")
    assert os.listdir(tmp_path) == []


def test_two_recorders_of_one_path_leave_the_last_whole(tmp_path):
    path = tmp_path / "run.rrd"
    (mine := tmp_path / "run.rrd.part").write_text("mine")
    session, first = opened(path)
    with first:
        longer_session, second = opened(path, duration=0.2)
        with second:
            follow(longer_session, 200, [second])
            assert not path.exists()
        assert len(telemetry_of(path, "q_rad")[0]) == 200
        follow(session, session.scenario.ticks, [first])
    assert len(telemetry_of(path, "q_rad")[0]) == 100
    assert sorted(os.listdir(tmp_path)) == ["run.rrd", "run.rrd.part"]
    assert mine.read_text() == "mine"


@pytest.mark.parametrize("there", [True, False])
def test_recording_at_a_link_replaces_the_file_behind_it(tmp_path, there):
    (folder := tmp_path / "folder").mkdir()
    if there:
        (folder / "real.rrd").write_text("old")
    (link := tmp_path / "link.rrd").symlink_to("folder/real.rrd")
    recorded(link)
    assert link.is_symlink()
    assert os.listdir(folder) == ["real.rrd"]
    assert len(telemetry_of(folder / "real.rrd", "q_rad")[0]) == 100


def broken_model(folder):
    """The shipped model with something else in place of a mesh."""
    shutil.copytree(actuators.FOLDER / "assets", folder / "assets")
    mesh = folder / "assets" / "stator.obj"
    mesh.write_text("no mesh")
    return shutil.copy(actuators.MJCF_PATH, folder / "broken.xml")


def test_mesh_that_cannot_be_read_is_bad_input_before_the_run(tmp_path):
    (folder := tmp_path / "model").mkdir()
    with pytest.raises(InputError, match=r"model .*broken\.xml: .*stator") as raised:
        opened(tmp_path / "run.rrd", **{"plant.mjcf": str(broken_model(folder))})
    assert "\n" not in f"{raised.value}"
    assert os.listdir(tmp_path) == ["model"]


LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), int(sys.argv[1])))
from spheretwin.cli import main
run = ["simulate", "hold", "--plant.engine", "lagrangian", "--duration", "0.5"]
sys.exit(main([*run, "--record", sys.argv[2], "--json"]))
"""


def limited(path, size):
    command = [sys.executable, "-c", LIMITED, f"{size}", path]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def size(tmp_path_factory):
    """Bytes of a complete recording; they vary from run to run, as the wall clock's time in it is packed."""
    recorded(path := tmp_path_factory.mktemp("whole") / "whole.rrd", duration=0.5)
    return path.stat().st_size


# Full from the first bytes, amid the chunks, and before the last bytes.
@pytest.mark.parametrize(
    ("share", "more"),
    [
        (0.5, 0),
        pytest.param(0, 100, marks=pytest.mark.release("1.5 s; half of the recording is in the first suite")),
        pytest.param(
            1, -2000, marks=pytest.mark.release("1.5 s; half of the recording is in the first suite")
        ),
    ],
)
def test_full_disk_costs_the_recording_and_not_the_run(tmp_path, size, share, more):
    path = tmp_path / "run.rrd"
    broken = limited(path, int(share * size) + more)
    assert broken.returncode == 1
    assert json.loads(broken.stdout)["status"] == "completed"
    (line,) = broken.stderr.splitlines()
    assert line.startswith(f"spheretwin: recording: {path} could not be completed, File too large;")
    (left_over,) = tmp_path.glob(f".{path.name}.*.part")
    assert line.endswith(f"{left_over}")
    assert not path.exists()
