"""Recordings read back: the telemetry bit for bit, poses, colours, texts and events."""

import json
import os
import shutil
import subprocess
import sys
import threading
import time

import numpy as np
import pyarrow as pa
import pytest
import rerun as rr
from rerun.chunk import RrdReader
from scipy.spatial.transform import Rotation

from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.kinematics import rotation
from spheretwin.models.telemetry.signals import common_signals, width
from spheretwin.models.telemetry.table import Table
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.records.facts import facts_of
from spheretwin.twin.session import Session
from spheretwin.twin.simulation import follow, simulate
from spheretwin.viz import palette
from spheretwin.viz.layout.paths import EVENTS, SCENARIO, TELEMETRY, TIMELINE
from spheretwin.viz.reading.reading import read
from spheretwin.viz.recording import recorder as recording
from spheretwin.viz.recording.recorder import Recorder
from spheretwin.viz.recording.stream import PENDING_CHUNKS
from spheretwin.viz.scene import paths as scene

SIGNALS = common_signals(18)


def recorded(path, name="nutation", **changes):
    scenario = scenarios.load(name, {"duration": 2.3, **changes})
    session = Session(scenario)
    facts = facts_of(session.scenario)
    with Recorder(session.actuator, session.signals, facts, path=path) as recorder:
        return session, simulate(scenario, sinks=[recorder])


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "run.rrd"
    session, finished = recorded(path)
    return path, session, finished


def rows_of(path, entity, component, field=None):
    """Times in ns and values of one component, or of one field of it, in order."""
    times, values = [], []
    chunks = (
        RrdReader(path).stream().filter(content=f"/{entity}", components=component, has_timeline=TIMELINE)
    )
    for chunk in chunks:
        batch = chunk.to_record_batch()
        column = batch.column(component)
        if field:
            column = column.flatten().field(field)
        while pa.types.is_nested(column.type):
            column = column.flatten()
        times.append(np.asarray(batch.column(TIMELINE).cast(pa.int64())))
        values.append(np.asarray(column).reshape(len(batch), -1))
    times, values = np.concatenate(times), np.concatenate(values)
    order = np.argsort(times, kind="stable")
    return times[order], values[order]


def test_every_signal_is_recorded_bit_for_bit(run):
    path, _, finished = run
    table = finished.telemetry
    ticks_ns = np.arange(len(table)) * 1_000_000
    for signal in table.signals:
        times, values = rows_of(path, TELEMETRY, "values_0", signal.name)
        np.testing.assert_array_equal(times, ticks_ns)
        assert values.tobytes() == np.ascontiguousarray(table[signal.name]).tobytes()


def test_signals_that_a_law_brings_on_the_way_change_no_component(tmp_path):
    """A viewer draws nothing of a component that changes its type; NaN stands for what a law does not log."""
    changes = [{"t_s": at, "set": "controller.law", "value": law} for at, law in ((0.1, "afsm"), (0.2, "pd"))]
    fields = {"controller.law": "pd", "duration": 0.3, "plant.engine": "lagrangian", "event": changes}
    with Session(scenarios.load("sinusoid", fields)) as session:
        facts, ticks, begun = facts_of(session.begun_as), session.begun_as.ticks, session.signals
        with Recorder(session.actuator, begun, facts, path=tmp_path / "run.rrd") as recorder:
            follow(session, ticks, [recorder])
    types = {}
    for chunk in RrdReader(tmp_path / "run.rrd").stream().filter(content=f"/{TELEMETRY}", is_static=False):
        for field in chunk.to_record_batch().schema:
            types.setdefault(field.name, set()).add(field.type)
    assert {"values_0", "values_1"} <= set(types)
    assert all(len(of_one) == 1 for of_one in types.values())
    table = read(tmp_path / "run.rrd").table
    assert "sliding_s" not in {signal.name for signal in begun}
    logged = np.isfinite(table["sliding_s"]).all(axis=1)
    np.testing.assert_array_equal(logged, np.arange(300) // 100 == 1)


def test_rotor_turns_as_the_telemetry_says(run):
    path, _, finished = run
    times, quaternions = rows_of(path, f"{scene.WORLD}/rotor", "Transform3D:quaternion")
    q = finished.telemetry["q_rad"][times // 1_000_000]
    for quaternion, pose in zip(quaternions, q, strict=True):
        # Rerun keeps poses in single precision.
        np.testing.assert_allclose(Rotation.from_quat(quaternion).as_matrix(), rotation(pose), atol=1e-6)


def test_frames_come_at_sixty_hertz(run):
    path, _, finished = run
    times, _ = rows_of(path, f"{scene.WORLD}/rotor", "Transform3D:quaternion")
    assert len(times) == pytest.approx(60 * finished.telemetry["t_s"][-1], abs=2)
    assert np.diff(times).max() <= 18_000_000


def test_both_coils_of_a_group_show_its_current(run):
    path, session, finished = run
    times, pixels = rows_of(path, scene.COILS, "Mesh3D:albedo_texture_buffer")
    colours = pixels.reshape(len(times), 36, 3)
    current = finished.telemetry["current_A"][times // 1_000_000]
    expected = palette.current_colours(current, session.scenario.drive.current_limit_A)
    for side in range(2):
        np.testing.assert_array_equal(colours[:, session.actuator.groups[:, side]], expected)


def static_text(path, entity, component):
    for chunk in RrdReader(path).stream().filter(content=f"/{entity}", is_static=True):
        batch = chunk.to_record_batch()
        if component in batch.schema.names:
            return batch.column(component).to_pylist()[0]
    raise AssertionError(f"no {component} at {entity}")


def test_resolved_scenario_is_in_the_recording(run):
    path, *_ = run
    text = static_text(path, SCENARIO, "TextDocument:text")[0]
    assert "| modelling_error | 0.2 |" in text
    assert "| current_limit_A | 8.0 |" in text


def test_series_have_names_with_units(run):
    path, *_ = run
    (styles,) = static_text(path, TELEMETRY, "styles_0")
    assert styles["error_rad"]["names"] == ["error α [rad]", "error β [rad]", "error γ [rad]"]


def texts(path):
    lines = []
    for chunk in RrdReader(path).stream().filter(content=f"/{EVENTS}"):
        lines += [row[0] for row in chunk.to_record_batch().column("TextLog:text").to_pylist()]
    return lines


def test_events_tell_of_saturation_and_the_end(run):
    path, *_ = run
    lines = texts(path)
    assert any("current limit reached" in line for line in lines)
    assert lines[-1] == "the run is complete"


def test_leaving_the_workspace_is_an_event(tmp_path):
    path = tmp_path / "run.rrd"
    _, finished = recorded(path, "sinusoid", **{"controller.law": "pd", "disturbance.load": 5.0})
    assert finished.status == "left_workspace"
    assert "end of its range" in texts(path)[-1]


def test_recording_carries_its_blueprint_and_name(run):
    path, *_ = run
    reader = RrdReader(path)
    assert len(reader.blueprints()) == 1
    assert reader.recordings()[0].application_id.startswith("spheretwin-")


def test_payload_is_drawn_where_it_is_mounted(tmp_path):
    path = tmp_path / "tilt.rrd"
    recorded(path, "tilt", duration=0.1)
    centre = static_text(path, f"{scene.WORLD}/rotor/payload", "Cylinders3D:centers")
    # A cylinder's centre is stored as the translation of its instance in some releases.
    np.testing.assert_allclose(np.ravel(centre[0]), [0, 0, 0.10], atol=1e-7)


def test_run_that_raises_still_leaves_a_readable_recording(tmp_path):
    path = tmp_path / "run.rrd"
    session = Session(scenarios.load("hold", {"duration": 0.1}))
    facts = facts_of(session.scenario)

    def interrupted():
        with Recorder(session.actuator, session.signals, facts, path=path) as recorder:
            follow(session, session.scenario.ticks, [recorder])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    times, _ = rows_of(path, TELEMETRY, "values_0", "q_rad")
    assert len(times) == 100


def test_unwritable_path_is_bad_input(tmp_path, actuator):
    facts = facts_of(scenarios.load("hold", {"drive.current_limit_A": 8.0}))
    with pytest.raises(InputError, match="writable"):
        Recorder(actuator, SIGNALS, facts, path=tmp_path / "missing" / "run.rrd")


def test_a_fault_while_recording_is_raised_not_lost(tmp_path):
    session = Session(scenarios.load("hold", {"duration": 0.1}))
    facts = facts_of(session.scenario)
    recorder = Recorder(session.actuator, session.signals, facts, path=tmp_path / "run.rrd")
    backwards = Table(SIGNALS, np.zeros((2, width(SIGNALS))))
    backwards.values[:, 0] = np.nan
    recorder.write(backwards)
    with pytest.raises(SpheretwinError, match=r"recording: .*run\.rrd could not be completed") as raised:
        recorder.close()
    (kept,) = os.listdir(tmp_path)
    assert f"{raised.value}".endswith(kept)


def hold_facts(**changes):
    session = Session(scenarios.load("hold", {"duration": 0.1, **changes}))
    return session, facts_of(session.scenario)


def test_a_folder_in_the_place_of_a_recording_is_told_with_where_the_recording_is(tmp_path):
    session, facts = hold_facts()
    recorder = Recorder(session.actuator, session.signals, facts, path=tmp_path / "run.rrd")
    follow(session, session.scenario.ticks, [recorder])
    (tmp_path / "run.rrd").mkdir()
    with pytest.raises(SpheretwinError, match=r"run\.rrd could not be written, ") as raised:
        recorder.close()
    (kept,) = tmp_path.glob(".run.rrd.*.part")
    assert f"{raised.value}".endswith(f"; the recording is in {kept}")
    assert len(rows_of(kept, TELEMETRY, "values_0", "q_rad")[0]) == 100


def test_closing_twice_is_closing_once(tmp_path):
    session, facts = hold_facts()
    with Recorder(session.actuator, session.signals, facts, path=tmp_path / "run.rrd") as recorder:
        follow(session, session.scenario.ticks, [recorder])
        recorder.close()
    assert os.listdir(tmp_path) == ["run.rrd"]


def test_where_a_pipe_has_no_path_rerun_writes_the_file(tmp_path, monkeypatch):
    monkeypatch.setattr(recording, "PIPE_PATHS", tmp_path / "none")
    recorded(path := tmp_path / "run.rrd", "hold", duration=0.1)
    assert len(rows_of(path, TELEMETRY, "values_0", "q_rad")[0]) == 100
    assert os.listdir(tmp_path) == ["run.rrd"]


def test_a_file_that_cannot_be_opened_again_leaves_nothing(tmp_path, monkeypatch):
    def out_of_handles():
        raise OSError(24, "Too many open files")

    session, facts = hold_facts()
    monkeypatch.setattr(os, "pipe", out_of_handles)
    with pytest.raises(InputError, match="Too many open files"):
        Recorder(session.actuator, session.signals, facts, path=tmp_path / "run.rrd")
    assert os.listdir(tmp_path) == []


def test_two_recorders_of_one_path_leave_the_last_whole(tmp_path):
    path = tmp_path / "run.rrd"
    (mine := tmp_path / "run.rrd.part").write_text("mine")
    session, facts = hold_facts()
    _, longer = hold_facts(duration=0.2)
    with Recorder(session.actuator, session.signals, facts, path=path) as first:
        with Recorder(session.actuator, session.signals, longer, path=path) as second:
            simulate(scenarios.load("hold", {"duration": 0.2}), sinks=[second])
            assert not path.exists()
        assert len(rows_of(path, TELEMETRY, "values_0", "q_rad")[0]) == 200
        follow(session, session.scenario.ticks, [first])
    assert len(rows_of(path, TELEMETRY, "values_0", "q_rad")[0]) == 100
    assert sorted(os.listdir(tmp_path)) == ["run.rrd", "run.rrd.part"]
    assert mine.read_text() == "mine"


@pytest.mark.parametrize("there", [True, False])
def test_recording_at_a_link_replaces_the_file_behind_it(tmp_path, there):
    (folder := tmp_path / "folder").mkdir()
    if there:
        (folder / "real.rrd").write_text("old")
    (link := tmp_path / "link.rrd").symlink_to("folder/real.rrd")
    recorded(link, "hold", duration=0.1)
    assert link.is_symlink()
    assert os.listdir(folder) == ["real.rrd"]
    assert len(rows_of(folder / "real.rrd", TELEMETRY, "values_0", "q_rad")[0]) == 100


def broken_model(folder, content):
    """The shipped model with one mesh missing, or with something else in its place."""
    shutil.copytree(actuators.FOLDER / "assets", folder / "assets")
    mesh = folder / "assets" / "stator.obj"
    mesh.unlink()
    if content is not None:
        mesh.write_text(content)
    return shutil.copy(actuators.MJCF_PATH, folder / "broken.xml")


@pytest.mark.parametrize("content", [None, "no mesh"], ids=["missing", "garbage"])
def test_mesh_that_cannot_be_read_is_bad_input_before_the_run(tmp_path, content):
    (folder := tmp_path / "model").mkdir()
    session, facts = hold_facts(**{"plant.mjcf": str(broken_model(folder, content))})
    with pytest.raises(InputError, match=r"model .*broken\.xml: .*stator") as raised:
        Recorder(session.actuator, session.signals, facts, path=tmp_path / "run.rrd")
    assert "\n" not in f"{raised.value}"
    assert os.listdir(tmp_path) == ["model"]


LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), int(sys.argv[1])))
from spheretwin.twin.cli import main
sys.exit(main(["simulate", "hold", "--duration", "0.5", "--record", sys.argv[2], "--json"]))
"""


def limited(path, size):
    command = [sys.executable, "-c", LIMITED, f"{size}", path]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_full_disk_costs_the_recording_and_not_the_run(tmp_path):
    whole = limited(tmp_path / "whole.rrd", 10**9)
    assert (whole.returncode, whole.stderr) == (0, "")
    size = (tmp_path / "whole.rrd").stat().st_size
    # Full from the first bytes, amid the chunks, and before the last bytes; the size varies by some bytes
    # from run to run, as the wall clock's time in it is packed.
    for full in (100, size // 2, size - 2000):
        path = tmp_path / f"{full}.rrd"
        broken = limited(path, full)
        assert broken.returncode == 1
        assert json.loads(broken.stdout)["status"] == "completed"
        (line,) = broken.stderr.splitlines()
        assert line.startswith(f"spheretwin: recording: {path} could not be completed, File too large;")
        (kept,) = tmp_path.glob(f".{path.name}.*.part")
        assert line.endswith(f"{kept}")
        assert not path.exists()


def busy(recorder):
    """Occupy the recorder's thread until the event that is returned."""
    done = threading.Event()
    recorder._submit(done.wait)
    return done


def test_run_waits_for_a_recorder_that_is_behind(tmp_path):
    session, facts = hold_facts()
    rows = Table(session.signals, np.zeros((1, width(session.signals))))
    with Recorder(session.actuator, session.signals, facts, path=tmp_path / "run.rrd") as recorder:
        done, written = busy(recorder), []

        def write_all():
            for _ in range(3 * PENDING_CHUNKS):
                recorder.write(rows)
                written.append(1)

        writer = threading.Thread(target=write_all)
        writer.start()
        try:
            while len(written) < PENDING_CHUNKS - 2:  # room for the work at hand, and for one before it
                time.sleep(0.001)
            time.sleep(0.05)  # time enough for hundreds more, were there no bound
            assert len(written) < PENDING_CHUNKS
        finally:
            done.set()
            writer.join()
    assert len(rows_of(tmp_path / "run.rrd", TELEMETRY, "values_0", "q_rad")[0]) == len(written)


def test_recorder_that_has_failed_keeps_no_run_waiting(tmp_path):
    session, facts = hold_facts()
    recorder = Recorder(session.actuator, session.signals, facts, path=tmp_path / "run.rrd")
    bad = Table(session.signals, np.full((2, width(session.signals)), np.nan))
    for _ in range(3 * PENDING_CHUNKS):
        recorder.write(bad)
    with pytest.raises(SpheretwinError, match="recording: "):
        recorder.close()


def test_strict_mode_is_on(run):
    # Without it Rerun turns a mistake into a warning and drops the data.
    assert rr.strict_mode()


def test_every_recording_is_an_application_of_its_own(tmp_path):
    """A viewer keeps one layout for each application, and figures of the run stand in the layout."""

    def application(name, **changes):
        recorded(path := tmp_path / f"{name}.rrd", **changes)
        return RrdReader(path).recordings()[0].application_id

    found = [
        application("a", duration=0.02),
        application("b", duration=0.02),
        application("c", duration=0.02, **{"controller.law": "pd"}),
    ]
    assert len(set(found)) == 3
    assert all(set(each) <= set("abcdefghijklmnopqrstuvwxyz0123456789-") for each in found)
