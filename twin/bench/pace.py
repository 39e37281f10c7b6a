"""Clock of a bench: the ticks of a chunk, the time of the next one, and the number of late ones."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

SLOWEST = 0.1
"""Slow motion, as a share of the clock's pace."""

FASTEST = 1e6
"""No machine reaches it: as fast as possible."""

CHUNK_s = 0.02
"""Wall time from one chunk to the next."""

# A chunk longer than this would keep STOP waiting.
LONGEST_s, SHORT_s = 0.01, 0.004
FIRST_TICKS, MOST_TICKS = 20, 4096

# Time lost beyond this is not made up.
LATE_s = 5 * CHUNK_s

WINDOW_s = 1.0


class Pace:
    """Pace of one bench.

    Parameters
    ----------
    clock : callable
        Seconds that never go back.

    Attributes
    ----------
    speed : float
        Commanded, as a multiple of the clock's.
    chunks, missed : int
        Chunks that had a deadline, and the late ones: completed after the next one was due.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self.speed = 1.0
        self.chunks = self.missed = 0
        self._most_ticks = FIRST_TICKS
        self._due: float | None = None
        self._done: deque[tuple[float, float]] = deque()

    @property
    def fastest(self) -> bool:
        """True if it runs as fast as possible."""
        return self.speed >= FASTEST

    @property
    def missed_share(self) -> float:
        """Share of the chunks that were late."""
        return self.missed / self.chunks if self.chunks else 0.0

    def realtime_factor(self) -> float:
        """Return simulated over wall time in the last second; 0 while time is paused."""
        now = self._clock()
        recent = [(at, t_s) for at, t_s in self._done if now - at <= WINDOW_s]
        if len(recent) < 2:
            return 0.0
        return (recent[-1][1] - recent[0][1]) / max(now - recent[0][0], 1e-9)

    def clear(self) -> None:
        """Reset the counts."""
        self.chunks = self.missed = 0
        self._most_ticks = min(self._most_ticks, FIRST_TICKS)
        self.rest()

    def rest(self) -> None:
        """Clear the deadline: time is paused."""
        self._due = None
        self._done.clear()

    def ease(self) -> None:
        """Begin with a chunk of one tick again: the next ones may take longer than the last ones."""
        self._most_ticks = 1

    def ticks(self, period_s: float) -> int:
        """Control ticks of the next chunk."""
        if self.fastest:
            return self._most_ticks
        return max(1, min(round(CHUNK_s * self.speed / period_s), self._most_ticks))

    def wait_s(self) -> float:
        """Time until the next chunk is due, s; 0 where it is."""
        if self._due is None:
            self._due = self._clock()
        return 0.0 if self.fastest else max(0.0, self._due - self._clock())

    def record_chunk(self, ticks: int, period_s: float, t_s: float, took_s: float) -> None:
        """Record a chunk: its ticks, the simulated time at its end, and the wall time that it took."""
        now = self._clock()
        if self._done and t_s < self._done[-1][1]:  # time went back
            self._done.clear()
        self._done.append((now, t_s))
        while now - self._done[0][0] > WINDOW_s:
            self._done.popleft()
        if took_s > LONGEST_s:
            self._most_ticks = max(1, self._most_ticks // 2)
        elif took_s < SHORT_s and ticks == self._most_ticks:
            self._most_ticks = min(2 * self._most_ticks, MOST_TICKS)
        if self.fastest or self._due is None:
            self._due = now
            return
        self._due += ticks * period_s / self.speed
        self.chunks += 1
        if now > self._due:
            self.missed += 1
            self._due = max(self._due, now - LATE_s)
