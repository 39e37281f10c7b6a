"""Engine of a sweep: it runs rows and returns each as it is finished."""

from __future__ import annotations

import itertools
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Sequence
from typing import NamedTuple

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.study import agreement
from spheretwin.study.grid import Grid, Row
from spheretwin.study.row import RowResult, Rows


class BatchResult(NamedTuple):
    """Results of a batch of another process.

    Attributes
    ----------
    results : list of (int, RowResult)
        Finished rows by number.
    checked : list of int
        Rows that were run on both plants.
    fault : str, optional
        Reason to stop the study.
    wall_s : float
        Duration of the rows.
    """

    results: list[tuple[int, RowResult]]
    checked: list[int]
    fault: str | None
    wall_s: float


class Work:
    """Runs rows; some of them on both plants.

    Attributes
    ----------
    rows : Rows
    faults : list of SpheretwinError
        Reasons for rows without a result that are no fault of these rows.
    checked : list of int
        Rows that were run on both plants.
    """

    def __init__(self, rows: Rows) -> None:
        self.rows = rows
        self.faults: list[SpheretwinError] = []
        self.checked: list[int] = []

    def __call__(self, rows: Sequence[Row]) -> list[RowResult | None]:
        """Results of rows; None for a row with a fault, and for the checked ones behind it."""
        results: dict[int, RowResult] = {}
        try:
            found = dict(zip((row.number for row in rows), self.rows.run(rows), strict=True))
            checked = [row for row in rows if self._is_checked(row, found[row.number])]
            results = {row.number: found[row.number] for row in rows if row not in checked}
            for row in agreement.check(self.rows, checked):
                self.checked.append(row.number)
                results[row.number] = found[row.number]
        except SpheretwinError as error:
            self.faults.append(error)
        return [results.get(row.number) for row in rows]

    def _is_checked(self, row: Row, result: RowResult) -> bool:
        return result.error is None and agreement.is_checked(row) and agreement.has_both(self.rows, row)


class Order(NamedTuple):
    """Rows that an engine has to run.

    Attributes
    ----------
    numbers : iterator of int
        Numbers of the rows.
    rows : int
        Count of the numbers.
    grid : Grid
        Of the study.
    work : Work
        Runs a row in this process. An engine adds the faults of other processes to it.
    threads : int, optional
        Largest number of rows at a time; number of cores unless given.
    address : str, optional
        Address of a cluster, for an engine that takes one.
    stop_requested : callable
        After True no row is started, and running rows are finished.
    """

    numbers: Iterator[int]
    rows: int
    grid: Grid
    work: Work
    threads: int | None
    address: str | None
    stop_requested: Callable[[], bool]

    def elsewhere(self, here: list[int]) -> Iterator[int]:
        """Yield the numbers that another process may run; the others, with stored telemetry, go to `here`."""
        local = set(self.work.rows.study.telemetry)
        for number in self.numbers:
            if number in local:
                here.append(number)
            else:
                yield number

    def landed(self, result: BatchResult) -> Iterator[tuple[Row, RowResult]]:
        """Take over the faults of a batch of another process; yield its rows with their results."""
        self.work.checked += result.checked
        for number, of_row in result.results:
            yield self.grid[number], of_row
        if result.fault is not None:
            self.work.faults.append(SpheretwinError(result.fault))


class Engine(NamedTuple):
    """One way of running rows.

    Attributes
    ----------
    run : callable
        Yields the rows of an order with their results, in any order; None for a row with a fault.
    takes_address : bool
        Whether it needs the address of a cluster.
    prepare : callable
        Returns the rows of a study as the engine runs them.
    in_process : bool
        Whether its blocks run in threads of this process: those of a tuning do.
    threads : int, optional
        Threads unless they are given; number of cores without it.
    """

    run: Callable[[Order], Generator[tuple[Row, RowResult | None]]]
    takes_address: bool = False
    prepare: Callable[[Rows], Rows] = lambda rows: rows
    in_process: bool = False
    threads: int | None = None


TASK_S = 0.5
"""Duration of a batch: an interruption waits for it, and a batch is stored as a whole."""

MOST_ROWS = 256
"""Largest batch: its rows are set up together, and larger blocks are no faster."""

# Losses of a batch of one row: a node may be lost by chance, but hardly as often as this.
MOST_LOSSES = 4


class Batches:
    """Batches of row numbers.

    The first batches have one row; their duration gives the size of the next. Towards the end batches become
    smaller, so that all cores are busy until the end.

    Parameters
    ----------
    numbers : iterator of int
    count : int
        Count of the numbers.
    first, most : int
        Rows of the first batch, and of the largest one.
    """

    def __init__(self, numbers: Iterator[int], count: int, first: int = 1, most: int = MOST_ROWS) -> None:
        self._numbers, self._left, self._most = numbers, count, most
        self._again: deque[list[int]] = deque()
        self._losses: Counter[int] = Counter()
        self.rows = first
        """Rows of a batch that takes about `TASK_S`."""

    def next(self, at_a_time: int) -> list[int]:
        """Next batch, empty if there is none; `at_a_time` of them run together."""
        if self._again:
            return self._again.popleft()
        share = -(-self._left // (2 * at_a_time))
        batch = list(itertools.islice(self._numbers, max(1, min(self.rows, share))))
        self._left -= len(batch)
        return batch

    def landed(self, rows: int, wall_s: float) -> None:
        """Adapt the size to a finished batch, by a limited factor: the first row of a process is slow."""
        fitting = TASK_S * rows / max(wall_s, 1e-9)
        self.rows = int(min(max(fitting, self.rows // 2, 1), 2 * self.rows, self._most))

    def lost(self, batch: list[int]) -> bool:
        """Take back a batch whose node or process was lost; False if it was lost too often.

        It runs again in two halves: a row that ends its process is soon alone.
        """
        self._losses.update(batch)
        if len(batch) == 1:
            self._again.append(batch)
            return self._losses[batch[0]] <= MOST_LOSSES
        middle = len(batch) // 2
        self._again += [batch[:middle], batch[middle:]]
        return True
