"""Distributions of times: latency and jitter of a link."""

from __future__ import annotations

from array import array

import numpy as np

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
