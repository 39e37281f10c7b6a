"""STOP and a free rotor: currents off at once or after a hold, until reset, whatever is waited for."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.bench import Bench
from spheretwin.bench.driver import HELD_s
from tests.twin.bench.cases import MODES, begun, bench, done, kept_rows, paused, said, same_when_replayed


@pytest.mark.parametrize("mode", MODES)
def test_stop_sets_zero_currents_from_the_next_tick_until_reset(tmp_path, mode):
    path = tmp_path / "run.parquet"
    with begun() as made:
        done(made, "record", telemetry=str(path))
        done(made, mode, **MODES[mode])
        made.advance(100)
        made.command("stop")
        made.advance(20)
        state = made.state()
        assert (state.mode, state.stopped) == ("off", True)
        for other in MODES:
            assert said(made, other, **MODES[other]) == f"bench: expected reset after STOP, received {other}"
        made.advance(20)
        done(made, "reset")
        assert not made.state().stopped
    rows = kept_rows(path)
    assert len(rows) == 140
    np.testing.assert_array_equal(rows["current_command_A"][100:], 0.0)
    np.testing.assert_array_equal(rows["torque_command_Nm"][100:], 0.0)
    if mode != "off":
        assert np.abs(rows["current_command_A"][99]).max() > 0.0
        # What is left in the coils fades with their time constant of 0.69 ms: 1e-12 of it after 20 ms.
        assert np.abs(rows["current_A"][120]).max() < 1e-11


def test_stop_does_not_wait_for_what_is_being_prepared(made):
    for _ in range(20):
        made.command("step")
        made.command("load", source="nowhere")
    stop = made.command("stop")
    made.advance(1)
    assert stop.done
    assert made.state().stopped


def test_commands_before_stop_do_not_undo_it(made):
    before = [made.command(name) for name in ("pause", "reset", "start")]
    made.command("stop")
    made.advance(1)
    assert [bool(ticket.refused) for ticket in before] == [False, True, True]
    assert made.state().stopped
    done(made, "reset")
    assert not made.state().stopped


def test_stop_wakes_the_thread():
    """In slow motion, where a chunk is 20 ms of the clock's, and while nothing runs at all."""
    with paused() as made:
        made.begin()
        made.command("speed", factor=0.1).wait(None)
        for running in (False, True):
            if running:
                assert made.command("reset").wait(None) == "done"
                assert made.command("start").wait(None) == "done"
            assert made.command("stop").wait(None) == "done"
            assert made.state().stopped
            for _ in range(2):  # the second one comes after the chunk that follows the first one
                assert made.command("limits").wait(None) == "done"
            assert made.state().running == running
            assert not any(made.state().current_command_A)


# Enough to tip the rotor over from any pose, and some friction, so that it comes to rest.
TIPPING = {"disturbance__load": 0.05, "plant__payload_kg": 0.05, "plant__viscous_Nm_s": [2e-3, 2e-3, 2e-3]}


STOPS = pytest.mark.release("compiles a loop of its own for 10 s; tests/twin/plant has its rest")


@STOPS
@pytest.mark.parametrize("command", ["off", "manual", "stop"])
def test_a_rotor_that_is_let_go_comes_to_rest_at_its_limit(command):
    arguments = {"group": 3, "current_A": 1.0} if command == "manual" else {}
    with begun("hold", plant__end_stops__on=True, **TIPPING) as bench:
        bench.advance(50)
        done(bench, command, **arguments)
        bench.advance(20_000)
        state = bench.state()
        assert (state.status, state.reason, state.tick) == ("running", None, 20_050)
        assert np.abs(state.qdot_rad_s[:2]).max() < 1e-3
        assert np.all(np.abs(state.q_rad[:2]) < np.radians(80))
        # Usable: the law brings it back.
        if command == "stop":
            done(bench, "reset")
            done(bench, "start")
        done(bench, "point", pose_rad=[0.2, 0.1, 0.0])
        bench.advance(6000)
        assert bench.state().error_mrad < 50


@STOPS
def test_the_bench_that_starts_without_arguments_can_be_left_without_currents():
    """No constant load may accelerate the axis without an end until the watchdog ends the run."""
    with Bench(scenarios.load("bench", {"plant.engine": "lagrangian"})) as bench:
        done(bench, "start")
        bench.advance(1000)
        done(bench, "off")
        bench.advance(15_000)
        assert (bench.state().mode, bench.state().status) == ("off", "running")
        done(bench, "hold")


@pytest.mark.uncompiled
def test_end_stops_are_on_unless_the_scenario_says_otherwise():
    for changes, expected in (
        ({}, True),
        ({"plant__end_stops__on": False}, False),
        ({"plant__end_stops__on": True}, True),
    ):
        with bench(**changes) as made:
            assert ("plant.end_stops.on", expected) in [field[:2] for field in made.fields()]
            done(made, "load", source="tilt", overrides={"plant.engine": "lagrangian"})
            assert ("plant.end_stops.on", True) in [field[:2] for field in made.fields()]
            assert "--plant.end-stops.on true" in made.command_line()


def test_a_stop_that_holds_brings_the_rotor_to_rest_and_then_switches_off(tmp_path):
    path = tmp_path / "run.parquet"
    with begun() as bench:
        done(bench, "record", telemetry=str(path))
        done(bench, "stop_mode", mode="hold")
        done(bench, "jog", rates_rad_s=[0.0, 0.0, 1.0])
        bench.advance(3000)
        done(bench, "stop")
        state = bench.state()
        assert (state.mode, state.stopped, state.stop_mode) == ("hold", True, "hold")
        assert state.note == "STOP: holds, then zero currents until reset"
        for name, arguments in (("point", {"pose_rad": [0, 0, 0]}), ("off", {}), ("manual", {"group": 1})):
            assert "expected reset after STOP" in said(bench, name, **arguments)
        while bench.state().mode == "hold":
            bench.advance(20)
        tick = bench.state().tick
        assert bench.state().mode == "off"
        bench.advance(100)
    rows = kept_rows(path)
    # It was at rest for the stated time, and the currents are off from one tick on.
    at_rest = np.flatnonzero(np.abs(rows["qdot_ref_rad_s"]).max(axis=1) > 1e-12)[-1]
    assert tick - at_rest == pytest.approx(HELD_s / 1e-3, abs=45)  # two chunks of 20 ticks, and the profile
    assert np.abs(rows["qdot_rad_s"][tick - 20]).max() < 1e-2
    assert np.any(rows["current_command_A"][tick - 21])
    assert not np.any(rows["current_command_A"][tick:])
    assert same_when_replayed(path)


def test_a_second_stop_switches_off_at_once_and_stops_do_not_fill_the_journal(made):
    done(made, "stop_mode", mode="hold")
    done(made, "stop")
    assert made.state().mode == "hold"
    done(made, "stop")
    assert made.state().mode == "off"
    journal = made.state().journal
    for _ in range(1000):
        made.command("stop")
    made.advance(1)
    assert made.state().journal == journal
    assert not np.any(made.state().current_command_A)


def test_a_stop_that_holds_leaves_a_free_rotor_free(made):
    done(made, "stop_mode", mode="hold")
    done(made, "off")
    made.advance(10)
    done(made, "stop")
    assert made.state().mode == "off"


def test_a_reset_releases_a_stop_that_holds(made):
    done(made, "stop_mode", mode="hold")
    done(made, "stop")
    done(made, "reset")
    done(made, "start")
    made.advance(3000)
    state = made.state()
    assert (state.mode, state.stopped) == ("trajectory", False)
    assert state.stop_mode == "hold"  # it is a choice of the person, not of the run
