"""Time of the bench: STOP, pace, and its counts; with a clock of the test if possible."""

import numpy as np
import pytest

from tests.twin.bench.cases import MODES, begun, done, kept_rows, paused, said


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
