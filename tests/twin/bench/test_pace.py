"""Time of the bench: STOP, pace, and its counts; with a clock of the test if possible."""

import numpy as np
import pytest

from spheretwin.bench.pace import MOST_TICKS, CHUNK_s, LATE_s, Pace
from tests.twin.bench.cases import MODES, begun, done, kept_rows, paused, said
from tests.twin.bench.test_operators import Clock


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


@pytest.fixture
def clock():
    return Clock()


def run(pace, clock, chunks, took_s=0.001, period_s=1e-3):
    """Chunks one after the other; returns the times at which they began, and simulated time."""
    begins, t_s = [], 0.0
    for _ in range(chunks):
        clock.now += pace.wait_s()
        begins.append(clock.now)
        ticks = pace.ticks(period_s)
        t_s += ticks * period_s
        clock.now += took_s
        pace.record_chunk(ticks, period_s, t_s, took_s)
    return begins, t_s


def test_late_chunks_are_counted_and_made_up_within_a_bound(clock):
    pace = Pace(clock)
    run(pace, clock, 11)
    clock.now += 2.5 * CHUNK_s
    begins, _ = run(pace, clock, 4)
    assert pace.missed == 1
    # Back on the old beat.
    assert begins[-1] == pytest.approx(14 * CHUNK_s, abs=1e-9)
    clock.now += 60.0
    begins, _ = run(pace, clock, 50)
    made_up_for = int(np.sum(np.diff(begins) < CHUNK_s / 2))
    assert 0 < made_up_for <= LATE_s / CHUNK_s + 1
    assert begins[made_up_for + 1] - begins[0] < 0.15  # 0.1 s and a chunk are made up


def test_as_fast_as_possible_waits_for_nothing_and_has_no_deadlines(clock):
    pace = Pace(clock)
    pace.speed = 1e6
    _, t_s = run(pace, clock, 100, took_s=1e-4)
    assert pace.ticks(1e-3) == MOST_TICKS
    assert pace.chunks == 0
    assert clock.now == pytest.approx(0.01)
    assert pace.realtime_factor() == pytest.approx(t_s / 0.01, rel=0.05)
