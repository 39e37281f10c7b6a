"""Heap of a process with many large arrays."""

from __future__ import annotations

import ctypes
import sys

_MMAP_THRESHOLD = -3  # of malloc.h
_THRESHOLD_BYTES = 64 * 1024


def return_large_arrays() -> None:
    """Let the memory of a large array go back to the system when it is freed; only glibc needs it.

    glibc takes larger and larger arrays from its heap, as they are freed, until no request is too large for
    it. Blocks of a study, which come and go in several threads, then leave gaps: 10^5 rows took 0.6 GB more.
    """
    if sys.platform == "linux":
        set_option = getattr(ctypes.CDLL(None), "mallopt", None)
        if set_option is not None:
            set_option(_MMAP_THRESHOLD, _THRESHOLD_BYTES)
