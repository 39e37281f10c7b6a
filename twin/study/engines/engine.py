"""What an engine of a sweep is: it runs rows wherever it can, and hands over each as it is finished."""

from __future__ import annotations

import itertools
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator
from typing import NamedTuple

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.study import agreement
from spheretwin.study.grid import Grid, Row
from spheretwin.study.row import Result, Rows


class Work:
    """Runs a row; some of them on both plants.

    Attributes
    ----------
    rows : Rows
    faults : list of SpheretwinError
        Why rows have no result: no fault of theirs.
    checked : list of int
        Rows that were run on both plants.
    """

    def __init__(self, rows: Rows) -> None:
        self.rows = rows
        self.faults: list[SpheretwinError] = []
        self.checked: list[int] = []

    def __call__(self, row: Row) -> Result | None:
        """Result of a row; None where there is a fault."""
        try:
            result = self.rows.run(row)
            if result.error is None and self.rows.chooses_plant and agreement.is_checked(row):
                agreement.check(self.rows, row)
                self.checked.append(row.number)
        except SpheretwinError as error:
            self.faults.append(error)
            return None
        return result


class Order(NamedTuple):
    """What an engine is asked for.

    Attributes
    ----------
    numbers : iterator of int
        Of the rows to run.
    rows : int
        How many these are.
    grid : Grid
        Of the study.
    work : Work
        Runs a row here. What goes wrong elsewhere is added to it, as if it had been here.
    threads : int, optional
        Rows at most that run at a time; as many as there are cores unless given.
    address : str, optional
        Of the machines, for an engine that takes one.
    stop_requested : callable
        From True on no other row is begun, and those in flight are finished.
    """

    numbers: Iterator[int]
    rows: int
    grid: Grid
    work: Work
    threads: int | None
    address: str | None
    stop_requested: Callable[[], bool]


class Engine(NamedTuple):
    """One way of running rows.

    Attributes
    ----------
    run : callable
        Rows of an order with their results, in any order; None for one that has shown a fault.
    takes_address : bool
        Whether it can be told where its machines are.
    """

    run: Callable[[Order], Generator[tuple[Row, Result | None]]]
    takes_address: bool = False


TASK_S = 1.0

MOST_ROWS = 10_000

# Of a row alone in its batch: a node may be lost under it by chance, but hardly as often as this.
MOST_LOSSES = 4


class Batches:
    """Numbers of rows, cut into batches as they are asked for.

    The first hold a row each; how long these took says how many the next may hold. Towards the end they
    become smaller, so that all cores have something to do until it.

    Parameters
    ----------
    numbers : iterator of int
    count : int
        How many they are.
    """

    def __init__(self, numbers: Iterator[int], count: int) -> None:
        self._numbers, self._left = numbers, count
        self._again: deque[list[int]] = deque()
        self._losses: Counter[int] = Counter()
        self.rows = 1
        """Rows of a batch that takes about as long as it should."""

    def next(self, at_a_time: int) -> list[int]:
        """Next batch, empty where there is none; `at_a_time` of them are under way together."""
        if self._again:
            return self._again.popleft()
        share = -(-self._left // (2 * at_a_time))
        batch = list(itertools.islice(self._numbers, max(1, min(self.rows, share))))
        self._left -= len(batch)
        return batch

    def landed(self, rows: int, wall_s: float) -> None:
        """Learn from a batch that is finished; the first row of a process is slow, so only up to a factor."""
        fitting = TASK_S * rows / max(wall_s, 1e-9)
        self.rows = int(min(max(fitting, self.rows // 2, 1), 2 * self.rows, MOST_ROWS))

    def lost(self, batch: list[int]) -> bool:
        """Take a batch back whose node or process was lost; False where it has been lost too often.

        It comes again in two halves: a row that takes its process along is soon alone.
        """
        self._losses.update(batch)
        if len(batch) == 1:
            self._again.append(batch)
            return self._losses[batch[0]] <= MOST_LOSSES
        middle = len(batch) // 2
        self._again += [batch[:middle], batch[middle:]]
        return True
