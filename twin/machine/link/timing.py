"""Distributions of times: latency and jitter of a link."""

from __future__ import annotations

from array import array

import numpy as np


class Distribution:
    """Times, s, of which quantiles are reported."""

    def __init__(self) -> None:
        self._times_s = array("d")

    def add(self, time_s: float) -> None:
        """Add a time."""
        self._times_s.append(time_s)

    def figures(self) -> dict[str, float | None]:
        """Return median, 99th percentile and maximum in ms; None without times."""
        if not self._times_s:
            return dict.fromkeys(("p50_ms", "p99_ms", "max_ms"))
        times_ms = 1e3 * np.array(self._times_s)
        p50, p99 = np.percentile(times_ms, (50, 99)).tolist()
        return {"p50_ms": p50, "p99_ms": p99, "max_ms": float(times_ms.max())}
