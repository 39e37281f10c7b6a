"""Rows in threads: their loops run together, their Python does not."""

import threading
from types import SimpleNamespace

from spheretwin.control.law import Law
from spheretwin.models.base.turns import turn
from spheretwin.study.engines import threads
from spheretwin.study.engines.threads import run_each
from tests.twin.session_cases import session


def test_loops_of_two_rows_run_at_the_same_time():
    both = threading.Barrier(2)

    def meeting(t, reference, measurement, parameters, state, torque):
        if t == 0:
            both.wait()  # without end, unless the other loop runs too
        torque[:] = 0

    def work(number):
        return len(session(Law("meeting", meeting, [], []), name="hold").advance(3))

    assert sorted(run_each([1, 2], work, threads=2)) == [(1, 3), (2, 3)]


def test_work_may_run_items_itself():
    def work(number):
        return sum(result for _, result in run_each([number, number], lambda one: one + 1, threads=2))

    assert sorted(run_each([1, 2, 3], work, threads=2)) == [(1, 4), (2, 6), (3, 8)]


def test_items_are_worked_on_in_turns():
    inside, most = [], []

    def work(number):
        inside.append(number)
        most.append(len(inside))
        inside.remove(number)

    list(run_each(range(1000), work, threads=4))
    assert set(most) == {1}
    with turn():  # no thread kept it
        pass


def test_results_are_taken_in_blocks(monkeypatch):
    asleep, finished, pauses = threading.Event(), threading.Event(), []

    def pause(time_s):
        pauses.append(time_s)
        asleep.set()
        finished.wait()

    def work(number):
        asleep.wait()
        if number == threads.AHEAD - 1:
            finished.set()
        return -number

    # Only the name of this module: threads that other tests left behind sleep by the one of the library.
    monkeypatch.setattr(threads, "time", SimpleNamespace(sleep=pause))
    assert list(run_each(range(threads.AHEAD), work, threads=1)) == [(n, -n) for n in range(threads.AHEAD)]
    # One for all results, and one if the thread puts the last of them, or its end, later.
    assert 1 <= len(pauses) <= 3
