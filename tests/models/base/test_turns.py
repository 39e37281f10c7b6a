"""Turns of threads: one at a time, except outside of a turn."""

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from spheretwin.models.base.turns import outside_turn, turn
from tests.waiting import wait_for


def test_one_thread_at_a_time_has_the_turn():
    inside, most = [], []

    def work(number):
        for _ in range(200):
            with turn():
                inside.append(number)
                most.append(len(inside))
                sum(range(200))
                inside.remove(number)

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(work, range(4)))
    assert most == [1] * 800


def test_another_thread_has_the_turn_while_the_first_is_outside_of_its_own():
    first_is_outside, second_is_done = threading.Event(), threading.Event()
    order = []

    def first():
        with turn():
            with outside_turn:
                first_is_outside.set()
                second_is_done.wait()
            order.append("first again")

    def second():
        first_is_outside.wait()
        with turn():
            order.append("second")
        second_is_done.set()

    with ThreadPoolExecutor(2) as pool:
        for each in [pool.submit(first), pool.submit(second)]:
            each.result()
    assert order == ["second", "first again"]


def test_a_thread_without_a_turn_waits_for_none_outside():
    entered = threading.Event()

    def other():
        with outside_turn:
            entered.set()

    with turn():
        thread = threading.Thread(target=other)
        thread.start()
        wait_for(entered.is_set, while_alive=thread)
    thread.join()


def test_a_thread_that_is_outside_may_be_outside_again():
    """A function of the user may run a simulation, whose loop is outside too."""
    with ThreadPoolExecutor(1) as pool, turn():
        with outside_turn:
            with outside_turn:
                pass
            assert pool.submit(has_had_the_turn).result()
        other = pool.submit(has_had_the_turn)
        assert not other.done()
        with outside_turn:
            assert other.result()


def test_an_exception_ends_the_turn():
    with pytest.raises(ZeroDivisionError), turn():
        raise ZeroDivisionError
    with pytest.raises(ZeroDivisionError), turn(), outside_turn:
        raise ZeroDivisionError
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(has_had_the_turn).result()


def has_had_the_turn():
    with turn():
        return True
