"""Batches of rows, each about a second of work: what it costs to send one is then lost in it."""

from __future__ import annotations

import itertools
from collections import Counter, deque
from collections.abc import Iterator

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
