"""Parallel runs in threads of this process: of the local engine, of tunings and of experiments."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Generator, Iterable
from queue import SimpleQueue
from typing import TypeVar

from spheretwin.models.base.turns import outside_turn, turn
from spheretwin.study.engines.engine import MOST_ROWS, Batches, Engine, Order
from spheretwin.study.grid import Row
from spheretwin.study.row import RowResult

PAUSE_s = 0.02
"""Time in which results gather for the caller, which takes the interpreter lock from the thread that has the
turn."""

# Results of each thread that wait for the caller: enough that no thread waits, few enough to need no memory.
AHEAD = 16

T = TypeVar("T")
R = TypeVar("R")


def run_each(
    items: Iterable[T],
    work: Callable[[T], R],
    threads: int | None = None,
    stop_requested: Callable[[], bool] = lambda: False,
) -> Generator[tuple[T, R]]:
    """Yield each item with its result, in the order in which they finish.

    Each thread takes the next item by itself: a dispatcher would need a tenth of the time of a run of a
    millisecond. One thread at a time runs Python, the others run their compiled loops (`models.base.turns`).
    Results are yielded in blocks, at most `PAUSE_s` late.

    Parameters
    ----------
    items : iterable
        None of them is None.
    work : callable
        Runs an item. Its exceptions are raised in the thread of the caller.
    threads : int, optional
        Number of cores unless given.
    stop_requested : callable
        Called after each result. After True no item is started, and running items are finished.
    """
    count = threads or os.cpu_count() or 1
    source, results = iter(items), SimpleQueue[tuple[T, R] | BaseException | None]()
    lock, room, stopped = threading.Lock(), threading.Semaphore(AHEAD * count), threading.Event()

    def next_item() -> T | None:
        room.acquire()
        with lock:
            return None if stopped.is_set() else next(source, None)

    def run_items() -> None:
        try:
            while (item := next_item()) is not None:
                with turn():
                    result = work(item)
                results.put((item, result))
        except BaseException as error:  # the caller raises it
            results.put(error)
        results.put(None)
        room.release()  # another thread may wait for it, only to end

    crew = [threading.Thread(target=run_items, name=f"run_{i}") for i in range(count)]
    for thread in crew:
        thread.start()
    running = count
    try:
        while running:
            with outside_turn:  # of a caller that is itself such work
                if results.empty():
                    time.sleep(PAUSE_s)
                result = results.get()
            if isinstance(result, BaseException):
                raise result
            if result is None:
                running -= 1
                continue
            yield result
            if stop_requested():
                stopped.set()
            room.release()
    finally:
        stopped.set()
        room.release(count)
        with outside_turn:
            for thread in crew:
                thread.join()


def run(order: Order, first: int = 1, most: int = MOST_ROWS) -> Generator[tuple[Row, RowResult | None]]:
    """Yield the rows of an order with their results; sizes of batches as in `Batches`."""
    threads = order.threads or os.cpu_count() or 1
    batches = Batches(order.numbers, order.rows, first, most)
    timed = iter(lambda: [order.grid[number] for number in batches.next(threads)], [])

    def work(rows: list[Row]) -> tuple[list[RowResult | None], float]:
        started = time.perf_counter()
        return order.work(rows), time.perf_counter() - started

    for rows, (results, wall_s) in run_each(timed, work, threads, order.stop_requested):
        batches.landed(len(rows), wall_s)
        yield from zip(rows, results, strict=True)


ENGINE = Engine(run, in_process=True)
