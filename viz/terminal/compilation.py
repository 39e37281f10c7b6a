"""Announcement of a compilation on stderr, where stderr is a terminal."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from spheretwin.models.base.compilation import listening

PAUSE_s = 5.0
"""Shortest time between two lines."""


@contextmanager
def announced(clock: Callable[[], float] = time.monotonic) -> Iterator[None]:
    """Print how far a compilation is, while the block runs; silent if all machine code is in the cache."""
    if not sys.stderr.isatty():
        yield
        return
    announcement = _Announcement(clock)
    with listening(announcement):
        yield
    announcement.end()


class _Announcement:
    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock, self._functions = clock, 0
        self._start_s = self._last_s = 0.0

    def __call__(self, name: str) -> None:
        now_s = self._clock()
        if not self._functions:
            self._start_s = self._last_s = now_s
            _print("compiling the loop of this kind of run, once: 20 to 60 s on an idle core")
        elif now_s - self._last_s >= PAUSE_s:
            self._last_s = now_s
            _print(f"compiling: {self._functions} functions, {now_s - self._start_s:.0f} s")
        self._functions += 1

    def end(self) -> None:
        """Print the sum."""
        if self._functions:
            lasted_s = self._clock() - self._start_s
            _print(
                f"{self._functions} functions were compiled; the command took {lasted_s:.0f} s from then on"
            )


def _print(line: str) -> None:
    print(f"spheretwin: {line}", file=sys.stderr, flush=True)
