"""The local engine: rows over threads, which the loop lets run side by side."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from itertools import islice
from typing import TypeVar

from spheretwin.twin.study.engines.engine import Engine, Order
from spheretwin.twin.study.grid import Row
from spheretwin.twin.study.row import Result

# Rows handed to each thread ahead of time: enough that none waits, few enough that no memory gathers.
AHEAD = 4

T = TypeVar("T")


def carried_out(
    rows: Iterable[Row],
    work: Callable[[Row], T],
    threads: int | None = None,
    stop_requested: Callable[[], bool] = lambda: False,
) -> Generator[tuple[Row, T]]:
    """Results of rows, each as it is finished.

    Parameters
    ----------
    rows : iterable of Row
    work : callable
        Runs a row.
    threads : int, optional
        As many as there are cores unless given.
    stop_requested : callable
        Asked after each row; from True on no other is begun, and those in flight are finished.
    """
    count = threads or os.cpu_count() or 1
    waiting = iter(rows)
    with ThreadPoolExecutor(count, thread_name_prefix="row") as pool:
        flying: dict[Future[T], Row] = {}

        def take_off(most: int) -> None:
            for row in islice(waiting, most):
                flying[pool.submit(work, row)] = row

        take_off(AHEAD * count)
        try:
            while flying:
                landed, _ = wait(flying, return_when=FIRST_COMPLETED)
                for future in landed:
                    yield flying.pop(future), future.result()
                if stop_requested():
                    for future in list(flying):
                        if future.cancel():
                            del flying[future]
                else:
                    take_off(AHEAD * count - len(flying))
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _of_order(order: Order) -> Generator[tuple[Row, Result | None]]:
    rows = (order.grid[number] for number in order.numbers)
    return carried_out(rows, order.work, order.threads, order.stop_requested)


ENGINE = Engine(_of_order)
