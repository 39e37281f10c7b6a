"""Recordings of a bench replay to the same bytes, for any commands, refusals and readers."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spheretwin.models.telemetry.run_record import RunRecord
from spheretwin.models.telemetry.table import read_parquet
from tests.twin.bench.cases import MODES, begun, done, kept_rows, paused, said, same_when_replayed

SETTINGS = [
    ("controller.law", "pd"),
    ("controller.law", "afsm"),
    ("disturbance.load", 0.2),
    ("plant.payload_kg", 0.02),
    ("plant.modelling_error", 0.1),
    ("allocation", "bounded"),
    ("trajectory.amplitude_rad", [0.1, 0.1, 0.1]),
    ("controller.stiffness", [80.0, 80.0, 80.0]),  # of some laws; refused under the others
    ("controller.period_s", 2e-3),  # waits for a reset
    ("disturbance.load", -1e9),
]
OTHERS = [
    ("add_fault", {"fault": {"target": "coil.07", "mode": "open"}}),
    ("clear_faults", {}),
    ("pause", {}),
    ("start", {}),
    ("snapshot", {}),
    ("limits", {"rate_rad_s": 2.0}),
]
COMMANDS = [*MODES.items(), *(("set", {"name": name, "value": value}) for name, value in SETTINGS), *OTHERS]


@settings(max_examples=12)
@given(st.lists(st.tuples(st.integers(0, 150), st.sampled_from(COMMANDS)), min_size=1, max_size=12))
def test_any_sequence_of_commands_replays_to_the_same_bytes(tmp_path_factory, sequence):
    path = tmp_path_factory.mktemp("run") / "run.parquet"
    with begun(plant__engine="mujoco") as made:
        done(made, "record", telemetry=str(path))
        for ticks, (name, arguments) in sequence:
            made.advance(ticks)
            said(made, name, **arguments)
        done(made, "start")
        made.advance(20)
    assert same_when_replayed(path)


STOPS = pytest.mark.release("compiles a loop of its own for 10 s; the other row replays as much")


@pytest.mark.parametrize(
    "changes",
    [
        {"hardware": "electronics", "plant.engine": "mujoco", "watchdog.on": False},
        pytest.param({"plant.end_stops.on": True}, marks=STOPS),
    ],
    ids=str,
)
def test_a_recording_begun_during_a_run_replays_to_the_same_bytes(tmp_path, changes):
    path = tmp_path / "run.parquet"
    with begun(**changes) as made:
        made.advance(111)
        done(made, "set", name="controller.law", value="pd")
        done(made, "hold")
        made.advance(89)
        done(made, "record", telemetry=str(path))
        for name, arguments in MODES.items():
            done(made, name, **arguments)
            made.advance(100)
        done(made, "keep")
        made.advance(50)
    rows, metadata = read_parquet(path)
    record = RunRecord.from_metadata(metadata)
    assert (record.first_tick, record.ticks, len(rows)) == (200, 800, 600)
    np.testing.assert_allclose(rows["t_s"][0], 0.2, rtol=1e-15)
    assert same_when_replayed(path)


def test_reset_and_restore_end_a_recording_which_still_replays(tmp_path):
    first, second = tmp_path / "first.parquet", tmp_path / "second.parquet"
    with begun() as made:
        made.advance(50)
        done(made, "snapshot")
        done(made, "record", telemetry=str(first))
        made.advance(70)
        done(made, "restore")
        assert made.state().recording == ()
        assert "time went back" in made.state().note
        done(made, "record", telemetry=str(second))
        done(made, "set", name="controller.law", value="pid")
        made.advance(30)
        done(made, "reset")
        assert (made.state().tick, made.state().running) == (0, False)
    assert [len(kept_rows(path)) for path in (first, second)] == [70, 30]
    assert same_when_replayed(first)
    assert same_when_replayed(second)


def ran(tmp_path, name, *, chunk, looked=False, refused=False):
    path = tmp_path / f"{name}.parquet"
    with begun() as made:
        done(made, "record", telemetry=str(path))
        for command in ("hold", "trajectory", "off", "hold"):
            done(made, command)
            left = 120
            while left:
                left -= made.advance(min(chunk, left))
                if looked:
                    made.state(), made.bins(), made.fields(), made.command_line(), made.scenario_toml()
                if refused:
                    assert said(made, "set", name="disturbance.load", value="heavy")
                    assert said(made, "set", name="no.such.field", value=1)
                    assert said(made, "point", pose_rad=[0.0, 9.0, 0.0])
    return path.read_bytes()


def test_neither_chunks_nor_looks_nor_refused_commands_change_a_byte(tmp_path):
    plain = ran(tmp_path, "plain", chunk=120)
    assert ran(tmp_path, "chunks", chunk=7) == plain
    assert ran(tmp_path, "looked", chunk=40, looked=True) == plain
    assert ran(tmp_path, "refused", chunk=40, refused=True) == plain


def test_a_twin_in_a_thread_runs_what_is_commanded_as_one_without(tmp_path):
    """The clock decides at which tick a command acts, and the journal says at which one it did."""
    path = tmp_path / "run.parquet"
    with paused() as made:
        made.begin()
        for name, arguments in [
            ("speed", {"factor": 1e6}),
            ("record", {"telemetry": str(path)}),
            ("start", {}),
            *MODES.items(),
            ("hold", {}),
            ("set", {"name": "disturbance.load", "value": 0.01}),
            ("pause", {}),
            ("keep", {}),
        ]:
            assert made.command(name, **arguments).wait(None) == "done"
    assert len(kept_rows(path)) > 0
    assert same_when_replayed(path)
