"""Bounds of all that a run shows, in a memory that does not grow with it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.signals import Signal, offsets
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.layout.seen import Seen

Array = NDArray[np.float64]

# Beyond twice as many, two neighbours become one.
SPANS = 512


class Survey:
    """Bounds of channels over spans of a run.

    Parameters
    ----------
    sizes : mapping of name to int
        The channels, and the entries of each.
    """

    def __init__(self, sizes: Mapping[str, int]) -> None:
        self._sizes = dict(sizes)
        width = sum(sizes.values())
        self._t_s: Array = np.empty(0)
        self._low: Array = np.empty((0, width))
        self._high: Array = np.empty((0, width))

    def add(self, t_s: Array, low: Array, high: Array) -> None:
        """Add spans, each with the bounds of all channels side by side."""
        self._t_s = np.concatenate([self._t_s, t_s])
        self._low = np.concatenate([self._low, low])
        self._high = np.concatenate([self._high, high])
        while len(self._t_s) > 2 * SPANS:
            pairs = np.arange(0, len(self._t_s), 2)
            self._t_s = self._t_s[pairs]
            self._low = np.fmin.reduceat(self._low, pairs, axis=0)
            self._high = np.fmax.reduceat(self._high, pairs, axis=0)

    def seen(self, ended_s: float | None) -> Seen | None:
        """All of it, once there is some."""
        if not len(self._t_s):
            return None
        return Seen(self._t_s, self._parted(self._low), self._parted(self._high), ended_s)

    def _parted(self, bounds: Array) -> dict[str, Array]:
        ends = np.cumsum(list(self._sizes.values()))[:-1]
        return dict(zip(self._sizes, np.split(bounds, ends, axis=1), strict=True))


def watched(signals: tuple[Signal, ...]) -> dict[str, int]:
    """Signals that are plotted in ranges of the run's own, of which bounds are kept; with their sizes."""
    plotted = (signal for signal in signals if not signal.states)
    return {signal.name: signal.size for signal in plotted if signal.name not in _OF_FIXED_RANGE}


_OF_FIXED_RANGE = frozenset(
    {
        "t_s",
        "error_rad",
        "torque_Nm",
        "current_command_A",
        "current_A",
        "mean_current_A",
        "allocation_scale",
        "coil_power_W",
        "copper_loss_W",
        "voltage_limited",
        "current_limited",
        "time_to_detection_s",
    }
)
"""And those that are not plotted."""


class Picked:
    """Columns of the watched signals side by side.

    Parameters
    ----------
    sizes : mapping of name to int
        The signals.
    """

    def __init__(self, sizes: Mapping[str, int]) -> None:
        self._sizes = dict(sizes)
        self._signals: tuple[Signal, ...] | None = None
        self._places = self._missing = np.empty(0, dtype=np.int64)

    def of(self, rows: Table) -> Array:
        """Of the rows of a chunk; NaN where they have none, after a change of law."""
        if rows.signals is not self._signals:
            self._signals = rows.signals
            self._find(rows.signals)
        columns = rows.values[:, self._places]
        columns[:, self._missing] = np.nan
        return columns

    def _find(self, signals: tuple[Signal, ...]) -> None:
        first, places = offsets(signals), []
        for name, size in self._sizes.items():
            places += list(range(first[name], first[name] + size)) if name in first else [-1] * size
        found = np.array(places, dtype=np.int64)
        self._places, self._missing = np.maximum(found, 0), np.flatnonzero(found < 0)
