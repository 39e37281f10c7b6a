"""The thread of a bench: turn by turn, each chunk at its time."""

from __future__ import annotations

import sys
import threading

from spheretwin.twin.bench.keeping import warm
from spheretwin.twin.bench.work.taking import Taking
from spheretwin.twin.bench.work.turning import Turning
from spheretwin.twin.bench.work.works import Works

# How long a thread may keep the interpreter from the loop's: of Python's own 5 ms, three make a chunk late.
SWITCH_s = 1e-3

# How often a bench at rest looks for clients that are gone.
REST_s = 0.02


class Thread:
    """Thread of one bench, which begins once.

    Parameters
    ----------
    works : Works
    taking : Taking
    turning : Turning
    """

    def __init__(self, works: Works, taking: Taking, turning: Turning) -> None:
        self._works, self._taking, self._turning = works, taking, turning
        self._thread: threading.Thread | None = None

    @property
    def begun(self) -> bool:
        """Whether it is at work, or was."""
        return self._thread is not None

    def begin(self) -> None:
        """Be at work from now on; until `end`, the interpreter goes from thread to thread more often."""
        warm()  # here: beside the loop it makes its first chunks late
        self._switch_s = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH_s)
        self._thread = threading.Thread(target=self._loop, name="bench", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Wait until the last turn is done, as no more commands are taken."""
        self._taking.wake.set()
        if self._thread and self._thread.is_alive():
            self._thread.join()
            sys.setswitchinterval(self._switch_s)

    def _loop(self) -> None:
        """Chunk by chunk, each at its time; woken by STOP."""
        works, pace, wake = self._works, self._works.pace, self._taking.wake
        while self._taking.open:
            moves = works.moves
            wait_s = pace.wait_s() if moves else REST_s
            if wait_s > 0 and wake.wait(wait_s):
                wake.clear()
                self._turning.turn(0, waits=False)
                continue
            if not moves:
                pace.rest()
            self._turning.turn(pace.ticks(works.period_s) if moves else 0, waits=False)
