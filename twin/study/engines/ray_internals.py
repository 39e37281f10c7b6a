"""Internals of Ray: the switch of the messages that its driver prints."""

from __future__ import annotations

from typing import Any


def silence(ray: Any) -> None:
    """Keep the messages of lost nodes off stdout, which contains the result of a sweep alone.

    ``log_to_driver=False`` silences the workers. Another thread of the driver prints the messages of a node
    that is lost, and Ray has no public switch for it. If Ray drops the internal one, a sweep still runs, but
    these messages appear between its results.
    """
    ray._private.worker._worker_logs_enabled = False
