"""A loop that does not return: noticed, shown with zero currents, its files completed."""

import threading
import time
from pathlib import Path

import pytest

from spheretwin.bench import cycle, supervisor
from spheretwin.bench.supervisor import PERIOD_s, Supervisor, TICKS_s, processor_time_s
from tests.twin.bench.cases import begun, done, kept_rows
from tests.waiting import UNLIMITED_S, wait_for

# It waits in its step until the test lets it go: a thread that never returns would stay in this process.
LAW = """
import threading
GO = threading.Event()

def waits(t, reference, measurement, parameters, state, torque):
    torque[:] = 0.01
    if t > 0.05:
        GO.wait()
"""


def test_a_law_that_does_not_return_stalls_the_loop(made, tmp_path, monkeypatch):
    monkeypatch.setattr(cycle, "TICKS_s", TICKS_s)
    (file := tmp_path / "law.py").write_text(LAW)
    telemetry = tmp_path / "run.parquet"
    done(made, "set", name="controller.law", value=f"{file}:waits")
    law = made._bench_state.driver.session.law.step.__globals__
    done(made, "record", telemetry=str(telemetry))
    made.begin()
    try:
        wait_for(lambda: made.state().mode == "fault")
        state = made.state()
        assert state.reason.startswith("LOOP STALLED: the law ")
        assert (state.stopped, state.running, made.stalled) == (True, False, True)
        assert not any(state.current_command_A)
        assert not any(state.current_A)
        # The files are completed while the law still waits.
        wait_for(lambda: made.state().completed_files == (str(telemetry),))
        assert len(kept_rows(telemetry)) > 0
        assert made.command("stop").wait(None) == "done"  # it has happened
        ticket = made.command("hold")
        assert ticket.wait(None) == "refused"
        assert "expected Ctrl-C, as the loop has stalled" in ticket.refused
    finally:
        law["GO"].set()
    monkeypatch.setattr(cycle, "TICKS_s", UNLIMITED_S)
    wait_for(lambda: not made.stalled)
    ticket = made.command("hold")
    assert ticket.wait(None) == "refused"
    assert "expected reset" in ticket.refused
    assert made.command("set", name="controller.law", value="pd").wait(None) == "done"
    assert made.command("reset").wait(None) == "done"
    assert made.command("start").wait(None) == "done"
    made.until(lambda state: state.t_s > 0.1, UNLIMITED_S)  # it raises in a fault


def test_a_bench_whose_loop_never_returns_can_be_closed(tmp_path, monkeypatch):
    monkeypatch.setattr(cycle, "TICKS_s", TICKS_s)
    (file := tmp_path / "law.py").write_text(LAW)
    with begun() as bench:
        done(bench, "set", name="controller.law", value=f"{file}:waits")
        law = bench._bench_state.driver.session.law.step.__globals__
        bench.begin()
        wait_for(lambda: bench.state().mode == "fault")
    assert bench.state().reason.startswith("LOOP STALLED")
    assert not any(bench.state().current_command_A)
    law["GO"].set()


class Clock:
    """A clock of the supervisor's thread, and its periods one by one."""

    def __init__(self, periods_s):
        self.now, self._periods = 0.0, iter(periods_s)

    def monotonic(self):
        return self.now

    def wait(self, period_s):
        assert period_s == PERIOD_s
        step = next(self._periods, None)
        self.now += step or 0.0
        return step is None


def stalls(monkeypatch, periods_s, limit_s=TICKS_s, processor_s=lambda now_s: None):
    """Times at which a stall is noticed, for periods of the supervisor and processor time of the work."""
    clock, noticed = Clock(periods_s), []
    monkeypatch.setattr(supervisor, "processor_time_s", lambda thread: processor_s(clock.now))
    watching = Supervisor(lambda what: noticed.append(clock.now), lambda: None)
    monkeypatch.setattr(supervisor, "time", clock)
    monkeypatch.setattr(watching, "_ended", clock)
    with watching.limited("work", limit_s):
        watching._watch()
    return noticed


def test_a_stall_is_noticed_within_two_tenths_of_a_second(monkeypatch):
    # The first period may begin with the work just before it.
    assert stalls(monkeypatch, [PERIOD_s] * 20)[0] + PERIOD_s <= 0.2
    assert stalls(monkeypatch, [1.2 * PERIOD_s] * 20)[0] + 1.2 * PERIOD_s <= 0.2
    assert stalls(monkeypatch, [PERIOD_s] * 6) == []


def test_a_process_without_a_processor_is_no_stall(monkeypatch):
    """A period that is late itself does not count."""
    assert stalls(monkeypatch, [5.0] * 50) == []
    assert len(stalls(monkeypatch, [5.0, PERIOD_s] * 7)) == 1


def test_work_that_waits_for_a_processor_is_no_stall(monkeypatch):
    assert stalls(monkeypatch, [PERIOD_s] * 500, processor_s=lambda now_s: 7.0) == []
    computes = stalls(monkeypatch, [PERIOD_s] * 20, processor_s=lambda now_s: 7.0 + now_s)
    assert computes == stalls(monkeypatch, [PERIOD_s] * 20)
    # With a fifth of a processor it takes five times as long; the first period counts as computation.
    fifth = stalls(monkeypatch, [PERIOD_s] * 50, processor_s=lambda now_s: 7.0 + now_s / 5)
    assert fifth[0] == pytest.approx(PERIOD_s + 5 * (TICKS_s - PERIOD_s), abs=PERIOD_s)


def test_the_processor_time_of_a_thread_that_computes_and_of_one_that_waits():
    here, end = threading.get_native_id(), threading.Event()
    before_s = processor_time_s(here)
    if before_s is None:  # a system without accounts of single threads, as in the tests before
        assert not Path("/proc/self/schedstat").exists()
        return
    while processor_time_s(here) - before_s < 0.05:  # this thread computes
        pass
    assert processor_time_s(here) <= before_s + 0.05 + time.thread_time()
    waiting = threading.Thread(target=end.wait)
    waiting.start()
    wait_for(lambda: processor_time_s(waiting.native_id) is None)
    end.set()
    waiting.join()
    assert processor_time_s(2**22 + 1) is None  # more than there can be


def test_work_that_returns_is_no_stall_and_late_work_is_reported_as_returned():
    returned, in_time = threading.Event(), threading.Event()
    watching = Supervisor(lambda what: in_time.set(), returned.set)
    with watching.limited("work", 10.0):
        pass
    assert not returned.is_set()
    watching.begin()
    with watching.limited("work", 0.0):
        in_time.wait()
    assert returned.is_set()
    watching.end()


@pytest.mark.parametrize("limit_s", [0.0, 1.0])
def test_an_error_in_the_work_passes(limit_s):
    with pytest.raises(ZeroDivisionError), Supervisor(print, lambda: None).limited("work", limit_s):
        raise ZeroDivisionError
