"""Waiting for events of other processes and threads: as long as they take."""

import time

UNLIMITED_S = 1000.0
"""Largest time-out that links and pages accept, for tests in which none occurs, s."""


def wait_for(condition):
    """Wait until a condition is true, and return its value.

    Without a limit: a test that hangs is seen by the stacks that pytest prints (`faulthandler_timeout`).
    """
    while not (value := condition()):
        time.sleep(0.01)
    return value
