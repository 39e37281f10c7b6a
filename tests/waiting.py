"""Waiting for events of other processes and threads, as long as a busy machine may need for them."""

import time

PATIENCE_S = 600.0
"""Time after which a test gives up, s; no test passes because of it."""


def wait_for(condition, message="the event"):
    """Wait until a condition is true, and return its value."""
    until = time.monotonic() + PATIENCE_S
    while not (value := condition()):
        assert time.monotonic() < until, f"not within {PATIENCE_S:g} s: {message}"
        time.sleep(0.01)
    return value
