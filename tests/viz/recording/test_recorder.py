"""Recordings read back: the telemetry bit for bit, poses, colours, texts and events."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader
from scipy.spatial.transform import Rotation

from spheretwin import scenario as scenarios
from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.kinematics import rotation
from spheretwin.models.telemetry.signals import common_signals, width
from spheretwin.models.telemetry.table import Table
from spheretwin.provenance import facts_of
from spheretwin.session import Session
from spheretwin.simulation import follow
from spheretwin.viz import theme
from spheretwin.viz.layout.view import EVENTS, SCENARIO, SUMMARY, TELEMETRY
from spheretwin.viz.recording.reader import read
from spheretwin.viz.recording.recorder import FEWEST_ROWS, Recorder
from spheretwin.viz.recording.stream import PENDING_CHUNKS
from spheretwin.viz.scene import meshes as scene
from tests.viz.recording.recordings import hold_facts, recorded, rows_of

SIGNALS = common_signals(18)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "run.rrd"
    session, finished = recorded(path)
    return path, session, finished


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
        facts, ticks, begun = (
            facts_of(session.initial_scenario),
            session.initial_scenario.ticks,
            session.signals,
        )
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


def test_groups_show_their_current_at_every_tick(run):
    path, session, finished = run
    times, pixels = rows_of(path, scene.COILS, "Mesh3D:albedo_texture_buffer")
    np.testing.assert_array_equal(times // 1_000_000, np.arange(len(finished.telemetry)))
    current = finished.telemetry["current_A"]
    expected = theme.current_colours(current, session.scenario.drive.current_limit_A)
    np.testing.assert_array_equal(pixels.reshape(len(times), 18, 3), expected)


def static_text(path, entity, component):
    for chunk in RrdReader(path).stream().filter(content=f"/{entity}", is_static=True):
        batch = chunk.to_record_batch()
        if component in batch.schema.names:
            return batch.column(component).to_pylist()[0]
    raise AssertionError(f"no {component} at {entity}")


def test_resolved_scenario_is_in_the_recording(run):
    path, *_ = run
    text = static_text(path, SCENARIO, "TextDocument:text")[0]
    assert static_text(path, SCENARIO, "TextDocument:media_type") == ["text/markdown"]
    changed, _, sections = text.partition("## Chosen, or different from the defaults")[2].partition("## run")
    assert "| plant.modelling_error | 0.2 |" in changed
    assert "| controller.law | afsm |" in changed
    assert "current_limit_A" not in changed
    assert "| current_limit_A | 8 |" in sections
    assert "| modelling_error | 0.2 |" in sections
    assert not any(sign in text for sign in ("None", "True", "False", "{", "["))


def test_series_have_names_with_units(run):
    path, *_ = run
    (styles,) = static_text(path, TELEMETRY, "styles_0")
    assert styles["error_rad"]["names"] == ["error α [rad]", "error β [rad]", "error γ [rad]"]


def texts(path):
    lines = []
    for chunk in RrdReader(path).stream().filter(content=f"/{EVENTS}", is_static=False):
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


def test_a_decimated_recording_of_a_run_that_raises_has_its_last_rows(tmp_path):
    path, chunks = tmp_path / "run.rrd", []
    session = Session(scenarios.load("nutation", {"duration": 0.2}))

    def interrupted():
        facts = facts_of(session.scenario)
        with Recorder(session.actuator, session.signals, facts, path=path, rate_Hz=60.0) as recorder:
            for _ in range(4):
                chunks.append(session.advance(50))
                recorder.write(chunks[-1])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    q_rad = np.concatenate([rows["q_rad"] for rows in chunks])
    times, recorded_q_rad = rows_of(path, TELEMETRY, "values_0", "q_rad")
    assert times[-1] == 199_000_000
    np.testing.assert_array_equal(recorded_q_rad[-1], q_rad[-1])
    np.testing.assert_array_equal(recorded_q_rad.max(axis=0), q_rad.max(axis=0))
    assert len(times) < 100


def busy(recorder):
    """Occupy the recorder's thread until the event that is returned."""
    done = threading.Event()
    recorder._submit(done.wait)
    return done


def test_run_waits_for_a_recorder_that_is_behind(tmp_path):
    session, facts = hold_facts()
    rows = Table(session.signals, np.zeros((FEWEST_ROWS, width(session.signals))))
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
    times, _ = rows_of(tmp_path / "run.rrd", TELEMETRY, "values_0", "q_rad")
    assert len(times) == FEWEST_ROWS * len(written)


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

    results = [
        application("a", duration=0.02),
        application("b", duration=0.02),
        application("c", duration=0.02, **{"controller.law": "pd"}),
    ]
    assert len(set(results)) == 3
    assert all(set(each) <= set("abcdefghijklmnopqrstuvwxyz0123456789-") for each in results)


def test_texts_have_escapes_for_characters_that_the_viewer_cannot_draw(tmp_path):
    session, facts = hold_facts()
    facts = replace(facts, name="漢 α Ж ß", description="😀 ±1 N·m – ok")
    with Recorder(session.actuator, session.signals, facts, path=(path := tmp_path / "run.rrd")) as recorder:
        recorder.write(session.advance(10))
        recorder.note(0.005, "law 漢.py:Ä")
        recorder.finish(session.status)
    name = "\\u6f22 α Ж ß"
    (headline,) = static_text(path, SUMMARY, "TextDocument:text")
    assert f"{name} under afsm" in headline
    (text,) = static_text(path, SCENARIO, "TextDocument:text")
    assert text.startswith(f"# {name}\n\n\\U0001f600 ±1 N·m – ok\n")
    assert "law \\u6f22.py:Ä" in texts(path)
    assert read(path).facts["name"] == "漢 α Ж ß"  # for readers of the data
