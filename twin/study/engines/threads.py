"""The local engine: rows over threads of this process, which the loop lets run side by side."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from queue import SimpleQueue
from typing import Generic, TypeVar

from spheretwin.study.engines.engine import Engine, Order
from spheretwin.study.grid import Row
from spheretwin.study.row import Result

# Rows of each thread that are not taken over yet: enough that none waits, few enough that no memory gathers.
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
    crew = _Crew(iter(rows), work, threads or os.cpu_count() or 1)
    try:
        for landed in crew.landed():
            yield landed
            crew.goes_on(not stop_requested())
    finally:
        crew.dismiss()


class _Crew(Generic[T]):
    """Threads each of which takes a row, runs it, puts down what came of it, and takes the next.

    Nobody hands rows out: for runs of a millisecond that would take a tenth of the time, and take it from the
    threads, which run Python one at a time.
    """

    def __init__(self, rows: Iterator[Row], work: Callable[[Row], T], count: int) -> None:
        self._rows, self._work = rows, work
        self._taking, self._room = threading.Lock(), threading.Semaphore(AHEAD * count)
        self._put_down: SimpleQueue[tuple[Row, T] | BaseException | None] = SimpleQueue()
        self._is_over = False
        self._threads = [threading.Thread(target=self._labour, name=f"row_{i}") for i in range(count)]
        for thread in self._threads:
            thread.start()

    def landed(self) -> Iterator[tuple[Row, T]]:
        """Rows with what came of them, until no thread is at work; raises what one of them raised."""
        at_work = len(self._threads)
        while at_work:
            found = self._put_down.get()
            if isinstance(found, BaseException):
                raise found
            if found is None:
                at_work -= 1
            else:
                yield found

    def goes_on(self, whether: bool) -> None:
        """Make room for a row more, as one was taken over; or let none be begun."""
        self._is_over |= not whether
        self._room.release()

    def dismiss(self) -> None:
        """Let no other row be begun, and wait for those in flight."""
        self._is_over = True
        self._room.release(len(self._threads))
        for thread in self._threads:
            thread.join()

    def _labour(self) -> None:
        try:
            while (row := self._next()) is not None:
                self._put_down.put((row, self._work(row)))
        except BaseException as error:  # it is the caller's, in whose thread it is raised
            self._put_down.put(error)
        self._put_down.put(None)

    def _next(self) -> Row | None:
        """Row to be run; None where there is none."""
        self._room.acquire()
        with self._taking:
            row = None if self._is_over else next(self._rows, None)
        if row is None:
            self._room.release()  # another thread may wait for it, only to end
        return row


def _of_order(order: Order) -> Generator[tuple[Row, Result | None]]:
    rows = (order.grid[number] for number in order.numbers)
    return carried_out(rows, order.work, order.threads, order.stop_requested)


ENGINE = Engine(_of_order)
