"""Supervisor of a bench's loop: it notices work that does not return, in a thread of its own."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

TICKS_s = 0.14
"""Longest computation of a chunk, usually 10 ms: with the period below, a stall is noticed within 0.2 s."""

COMMAND_s = 2.0
"""Longest execution of commands: a part of the loop may have to be built."""

PERIOD_s = 0.02


class _Work:
    """One piece of work of the loop, with its limit."""

    def __init__(self, what: str, limit_s: float) -> None:
        self.what, self.limit_s = what, limit_s
        self.waited_s, self.stalled = 0.0, False
        self._thread = threading.get_native_id()
        self._processor_s: float | None = None

    def wait(self) -> None:
        """Add a period, without the time in which the work waited for a processor."""
        before_s, now_s = self._processor_s, processor_time_s(self._thread)
        self.waited_s += PERIOD_s if before_s is None or now_s is None else min(PERIOD_s, now_s - before_s)
        self._processor_s = now_s


def processor_time_s(thread: int) -> float | None:
    """Return the processor time of a thread that computes or waits for a processor, s; None for another.

    Also None on systems without Linux's accounts of threads.
    """
    task = Path(f"/proc/self/task/{thread}")
    try:
        state = (task / "stat").read_text().rpartition(")")[2].split()[0]
        return 1e-9 * int((task / "schedstat").read_text().split()[0]) if state == "R" else None
    except (OSError, IndexError, ValueError):
        return None


class Supervisor:
    """Supervisor of one loop.

    Parameters
    ----------
    on_stall : callable
        Called in the supervisor's thread once the work has stalled, and every period until it returns. Takes
        the name of the work.
    on_return : callable
        Called in the loop's thread when stalled work returns.
    """

    def __init__(self, on_stall: Callable[[str], object], on_return: Callable[[], object]) -> None:
        self._on_stall, self._on_return = on_stall, on_return
        self._work: _Work | None = None
        self._lock, self._ended = threading.Lock(), threading.Event()

    def begin(self) -> None:
        """Start the thread."""
        threading.Thread(target=self._watch, name="bench supervisor", daemon=True).start()

    def end(self) -> None:
        """End the thread."""
        self._ended.set()

    @contextmanager
    def limited(self, what: str, limit_s: float) -> Iterator[None]:
        """Limit the time of the work in the block; the loop's thread uses it."""
        work = self._work = _Work(what, limit_s)
        try:
            yield
        finally:
            with self._lock:
                self._work = None
            if work.stalled:
                self._on_return()

    def _watch(self) -> None:
        """Add up the time of the present work.

        Time without a processor does not count: that of periods which were late themselves, and that in which
        the thread of the work waited for a processor.
        """
        before_s = time.monotonic()
        while not self._ended.wait(PERIOD_s):
            now_s = time.monotonic()
            late, before_s = now_s - before_s > 2 * PERIOD_s, now_s
            with self._lock:
                work = self._work
                if work is None:
                    continue
                if not late:
                    work.wait()
                if work.waited_s >= work.limit_s - 1e-9:  # sums of periods are rounded
                    work.stalled = True
                    self._on_stall(work.what)
