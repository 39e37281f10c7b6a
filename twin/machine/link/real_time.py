"""Real time: what the system permits to keep pauses out of a loop, and distributions of times."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from array import array
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

PRIORITY = 50
"""Of SCHED_FIFO, from 1 to 99; interrupt threads of Linux have 50, too."""

SWITCH_s = 1e-4
"""Longest time for which another thread keeps the interpreter from the loop."""

STATUS = Path("/proc/self/status")

_CURRENT, _FUTURE, _ON_FAULT = 1, 2, 4  # of mlockall: pages stay in memory from their first use on
_IPC_LOCK = 14  # bit of the capabilities of a process


class Granted(NamedTuple):
    """Permissions of the system for a loop."""

    locked_memory: bool
    """Pages in use stay in memory (`mlockall`)."""
    priority: bool
    """The thread runs before all ordinary ones (`SCHED_FIFO`)."""


@contextmanager
def real_time() -> Iterator[Granted]:
    """Keep garbage collection, paging and other processes out of a block, as far as the system permits."""
    collects, switch_s = gc.isenabled(), sys.getswitchinterval()
    gc.collect()
    gc.freeze()
    gc.disable()
    sys.setswitchinterval(SWITCH_s)
    granted = Granted(_lock_memory(), _raise_priority())
    try:
        yield granted
    finally:
        if granted.priority:
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        if granted.locked_memory:
            ctypes.CDLL(None).munlockall()
        sys.setswitchinterval(switch_s)
        gc.unfreeze()
        if collects:
            gc.enable()


def _lock_memory() -> bool:
    """Lock the memory of the process; a limited amount is not enough: later allocations would fail."""
    if sys.platform != "linux" or not _may_lock_all():
        return False
    return bool(ctypes.CDLL(None).mlockall(_CURRENT | _FUTURE | _ON_FAULT) == 0)


def _may_lock_all() -> bool:
    import resource  # POSIX alone

    if resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] == resource.RLIM_INFINITY:
        return True
    with suppress(OSError, StopIteration, ValueError):
        lines = STATUS.read_text().splitlines()
        bits = next(line.split()[1] for line in lines if line.startswith("CapEff:"))
        return bool(int(bits, 16) >> _IPC_LOCK & 1)
    return False


def _raise_priority() -> bool:
    """Raise the priority of this thread; threads and processes that it starts have the ordinary one."""
    if sys.platform != "linux":
        return False
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    except OSError:
        return False
    return True


QUANTILES = {"p50_ms": 50.0, "p99_ms": 99.0, "p999_ms": 99.9, "max_ms": 100.0}
"""Percentages by name."""


class Distribution:
    """Times, s, of which quantiles are reported."""

    def __init__(self) -> None:
        self._times_s = array("d")

    def add(self, time_s: float) -> None:
        """Add a time."""
        self._times_s.append(time_s)

    def figures(self) -> dict[str, float | None]:
        """Return quantiles and maximum in ms; None without times."""
        if not self._times_s:
            return dict.fromkeys(QUANTILES)
        times_ms = 1e3 * np.array(self._times_s)
        return dict(zip(QUANTILES, np.percentile(times_ms, list(QUANTILES.values())).tolist(), strict=True))
