"""Files of a bench: recordings, replay, and saved scenarios."""

import gc
import shlex
import weakref
from unittest.mock import Mock

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.analysis import recorded_run as reviewed
from spheretwin.analysis import run_summary
from spheretwin.bench import Bench
from spheretwin.bench.recording import RecordingThread
from spheretwin.models.telemetry.parquet import TelemetryFile
from spheretwin.scenario import reading
from tests.twin.bench.cases import FREE, begun, done, kept_rows, said


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Recording and telemetry of the ticks 200 to 700 of a run."""
    folder = tmp_path_factory.mktemp("kept")
    paths = folder / "run.rrd", folder / "run.parquet"
    with begun() as made:
        made.advance(200)
        done(made, "record", recording=str(paths[0]), telemetry=str(paths[1]))
        assert made.state().recording == tuple(map(str, paths))
        assert "expected keep before" in said(made, "record", telemetry=str(folder / "other.parquet"))
        done(made, "jog", rates_rad_s=[0.1, 0.0, 0.2])
        for _ in range(5):
            made.advance(100)
        done(made, "keep")
        assert made.state().recording == ()
        made.advance(10)
    assert made.state().mode == "jog"
    return paths


def test_a_recording_and_a_telemetry_file_hold_the_same_rows_from_then_on(files):
    recording, telemetry = (reviewed.read(path) for path in files)
    assert len(telemetry.table) == 500
    np.testing.assert_allclose(telemetry.table["t_s"][[0, -1]], [0.2, 0.699], rtol=1e-12)
    for signal in telemetry.table.signals:
        assert recording.table[signal.name].tobytes() == telemetry.table[signal.name].tobytes()
    assert any("trajectory set to" in text for _, _, text in recording.log)
    summary = run_summary.figures(telemetry)
    assert (summary["rows"], summary["status"]) == (500, "completed")


def test_a_closed_bench_has_completed_its_files_and_holds_none_of_them(tmp_path):
    paths = tmp_path / "run.rrd", tmp_path / "run.parquet"
    with begun() as made:
        done(made, "record", recording=str(paths[0]), telemetry=str(paths[1]))
        made.advance(50)
        # By type: `isinstance` would look into a weak proxy of another test, whose object may be gone.
        threads = [weakref.ref(each) for each in gc.get_objects() if type(each) is RecordingThread]
    assert made.state().completed_files == tuple(map(str, paths))
    assert made.state().recording == ()
    gc.collect()
    assert threads
    assert [thread() for thread in threads] == [None] * len(threads)


def test_an_error_of_a_file_is_reported_and_the_run_continues(tmp_path, monkeypatch):
    monkeypatch.setattr(TelemetryFile, "write", Mock(side_effect=OSError("the disk is full")))
    with begun() as made:
        done(made, "record", telemetry=str(tmp_path / "run.parquet"))
        assert made.advance(50) == 50
        done(made, "keep")
        assert made.advance(50) == 50
    assert made.state().completed_files == ()
    assert made.state().note == "the disk is full"


@pytest.mark.parametrize("place", [0, 1], ids=["recording", "telemetry"])
def test_a_replay_pauses_the_twin(made, files, place):
    rows = kept_rows(files[1])
    made.advance(100)
    q_rad = made.state().q_rad
    done(made, "replay", file=str(files[place]))
    state = made.state()
    assert (state.mode, state.tick, state.t_s) == ("replay", 1, rows["t_s"][0])
    for shown in (50, 300):
        made.advance(shown - made.state().tick)
        state = made.state()
        for name in ("q_rad", "q_ref_rad", "error_rad", "torque_Nm", "current_A"):
            assert getattr(state, name) == tuple(rows[name][shown - 1])
        assert state.t_s == rows["t_s"][shown - 1]
    np.testing.assert_array_equal(made.bins().rows["q_rad"], rows["q_rad"][:300:20])
    assert made.advance(1000) == 200
    assert not made.state().running
    # Back at the twin, which did not move.
    done(made, "hold")
    state = made.state()
    assert (state.mode, state.tick, state.q_rad) == ("hold", 100, q_rad)
    done(made, "start")
    assert made.advance(10) == 10
    done(made, "replay", file=str(files[place]))
    done(made, "stop")
    assert (made.state().mode, made.state().stopped) == ("off", True)


SETTINGS = [
    ("controller.law", "pd"),
    ("controller.stiffness", [60.0, 70.0, 80.0]),
    ("plant.payload_kg", 0.03),
    ("disturbance.terms", [{"kind": "constant", "torque_Nm": [0.001, 0.0, 0.0]}]),
    ("fault", [{"target": "coil.02", "mode": "open", "start_s": 0.5, "detection": True}]),
    ("trajectory", {"shape": "multisine"}),
    ("name", "mine"),
    ("hardware", "electronics"),
]


def test_the_settings_are_written_down_and_read_again_are_the_same(tmp_path):
    with begun(plant__engine="mujoco") as made:
        made.advance(30)
        for name, value in SETTINGS:
            path = tmp_path / f"{name}.toml"
            done(made, "set", name=name, value=value)
            done(made, "jog", rates_rad_s=[0.0, 0.1, 0.0])
            made.advance(3)
            done(made, "save", file=str(path))
            loaded = scenarios.load(str(path))
            assert path.read_text() == made.scenario_toml()
            words = shlex.split(made.command_line())
            assert words[:2] == ["spheretwin", "simulate"]
            assert scenarios.load(words[2], reading.overrides(words[3:])) == loaded
        # What the jogging made of it is no part of the settings.
        assert loaded.trajectory.shape == "multisine"
        assert loaded.trajectory.approach is None
        assert loaded.manual.currents_A is None
        done(made, "reset")
        known = {name: value for name, value, _ in made.fields()}
        for name, value in SETTINGS[:3]:
            assert np.all(np.array(known[name]) == np.array(value))
        done(made, "load", source=str(path))
        assert {name: value for name, value, _ in made.fields()} == known
        assert made.state().scenario == "mine"


@pytest.mark.parametrize("chunk", [1, 7, 50])
def test_a_change_is_logged_at_the_first_tick_on_which_it_acts(tmp_path, chunk):
    path = tmp_path / "run.rrd"
    with begun() as made:
        done(made, "record", recording=str(path))
        made.advance(chunk)
        done(made, "set", name="disturbance.load", value=0.5)
        made.advance(chunk)
        done(made, "keep")
    (t_s,) = (t_s for t_s, _, text in reviewed.read(path).log if "disturbance.load" in text)
    assert t_s == pytest.approx(chunk * 1e-3, abs=1e-9)


def test_sinks_receive_the_rows_of_all_runs():
    sink = Mock()
    with Bench(scenarios.load("sinusoid", FREE), sinks=[sink]) as made:
        done(made, "start")
        made.advance(25)
        done(made, "reset")
        done(made, "start")
        made.advance(10)
    t_s = np.concatenate([call.args[0]["t_s"] for call in sink.write.call_args_list])
    np.testing.assert_allclose(t_s, 1e-3 * np.concatenate([np.arange(25), np.arange(10)]), atol=1e-12)
