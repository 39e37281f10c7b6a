"""Waiting for events of other processes and threads: as long as they take."""

import subprocess
import time
from concurrent.futures import Future

UNLIMITED_S = 1000.0
"""Largest time-out that links and pages accept, for tests in which none occurs, s."""


def wait_for(condition, while_alive=None):
    """Wait until a condition is true, and return its value.

    Without a limit: a test that hangs is seen by the stacks that pytest prints (`faulthandler_timeout`).

    Parameters
    ----------
    condition : callable
    while_alive : Popen, Thread or Future, optional
        Producer of the event: the wait fails once it has ended without the event.
    """
    while True:
        # Before the condition, so that what it did last counts.
        ended = while_alive is not None and _has_ended(while_alive)
        if value := condition():
            return value
        if ended:
            output = while_alive.communicate() if isinstance(while_alive, subprocess.Popen) else ""
            raise AssertionError(f"{while_alive!r} has ended before the event {output}")
        time.sleep(0.01)


def _has_ended(producer):
    if isinstance(producer, subprocess.Popen):
        return producer.poll() is not None
    return producer.done() if isinstance(producer, Future) else not producer.is_alive()
