"""Bounds of all that a run shows, in a memory that does not grow with it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.signals import Signal
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
    """Signals of which bounds are kept, with their sizes: all that are plotted in a range of their own."""
    return {signal.name: signal.size for signal in signals if not signal.states and signal.unit != "A"}


def columns_of(rows: Table, sizes: Mapping[str, int]) -> Array:
    """Columns of some signals side by side; NaN where the rows have none, after a change of law."""
    names = {signal.name for signal in rows.signals}
    missing = np.full(len(rows), np.nan)
    return np.concatenate(
        [
            (rows[name] if name in names else np.tile(missing[:, None], size)).reshape(len(rows), size)
            for name, size in sizes.items()
        ],
        axis=1,
    )
