"""Sessions on threads, and one that two threads want."""

import threading
from concurrent.futures import ThreadPoolExecutor
from itertools import product

import pytest

from spheretwin.control.law import Law
from spheretwin.models.base.errors import SpheretwinError
from spheretwin.session import Session
from tests.twin.session_cases import ENGINES, SHIPPED, rows, same_future, scenario, session
from tests.waiting import wait_for


def test_runs_on_threads_are_those_made_one_after_the_other():
    fields = ("controller.law", "disturbance.load", "seed", "plant.engine")
    cases = product(SHIPPED, (0.0, 1.0, 2.0), (0, 1), ENGINES)
    runs = [dict(zip(fields, case, strict=True)) for case in cases]

    def made(changes):
        return rows(Session(scenario(**changes)).advance(400))

    serial = list(map(made, runs))
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(made, runs)) == serial
    assert len(set(serial)) == 36


def blocking(entered, go):
    """A plain Python law that stays within its call until it may go on."""

    def step(t, reference, measurement, parameters, state, torque):
        torque[:] = -0.5 * (measurement[0] - reference[0]) - 0.05 * (measurement[1] - reference[1])
        entered.set()
        go.wait()

    return Law("blocking", step, [], [])


def test_a_second_thread_is_refused_while_the_first_is_at_work():
    entered, go = threading.Event(), threading.Event()
    busy = session(blocking(entered, go), name="hold")
    with ThreadPoolExecutor(1) as pool:
        advancing = pool.submit(busy.advance, 20)
        wait_for(entered.is_set, while_alive=advancing)
        try:
            for call in (
                lambda: busy.advance(1),
                lambda: busy.advance(0),
                lambda: busy.set("disturbance.load", 2.0),
                busy.snapshot,
                lambda: busy.restore(None),
            ):
                with pytest.raises(SpheretwinError, match="one thread at a time"):
                    call()
        finally:
            go.set()
        first = advancing.result()
    alone = session(blocking(entered, go), name="hold")
    assert rows(first) == rows(alone.advance(20))
    assert busy.journal == ()
    assert same_future(busy, alone)


def test_a_law_cannot_call_the_session_that_calls_it():
    inside = []

    def step(t, reference, measurement, parameters, state, torque):
        torque[:] = 0.0
        try:
            inside[0].snapshot()
        except SpheretwinError as error:
            inside.append(str(error))

    inside.append(session(Law("curious", step, [], []), name="hold"))
    inside[0].advance(1)
    assert "one thread at a time" in inside[1]


def test_a_closed_session_is_refused():
    with session() as closed:
        taken = closed.snapshot()
    for call in (closed.snapshot, lambda: closed.restore(taken)):
        with pytest.raises(SpheretwinError, match="closed"):
            call()
    closed.close()  # a second time is nothing
