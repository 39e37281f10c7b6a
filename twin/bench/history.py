"""History of a bench: newest rows of the plotted signals, and the bounds of all rows between them."""

from __future__ import annotations

from collections import deque
from itertools import islice
from typing import NamedTuple

import numpy as np

from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry.signals import Signal, common_signals, width
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.bench.protocols import Bins

RATE_Hz = 50.0
LENGTH_s = 60.0

TEMPERATURE = "coil_temperature_degC"

# Time over which the variation of the commanded currents is averaged.
CHATTER_s = 1.0


def plotted_signals(groups: int) -> tuple[Signal, ...]:
    """Return the signals of every run, and the temperatures of the windings, NaN in a run without them."""
    return *common_signals(groups), Signal(TEMPERATURE, "°C", groups, "temperatures of the windings")


def plotted_values(rows: Table, signals: tuple[Signal, ...]) -> Array:
    """Return some signals of rows as (n, width); NaN for a signal that the rows do not have."""
    parts = [
        rows[signal.name].reshape(len(rows), -1)
        if signal.name in rows
        else np.full((len(rows), signal.size), np.nan)
        for signal in signals
    ]
    return np.concatenate(parts, axis=1)


class Bin(NamedTuple):
    """Rows within 1/50 s: the first of them, the bounds of all, and the variation of the commands."""

    number: int
    row: Array
    low: Array
    high: Array
    variation_A: float
    """Σ|Δi| of the commanded currents, mean over the groups."""


class History:
    """Newest rows of the plotted signals and bounds of all rows; a reader never delays the writer.

    Parameters
    ----------
    groups : int
        Coil groups.
    period_s : float, s
        Period of the rows that are written.
    """

    _created = 0

    def __init__(self, groups: int, period_s: float) -> None:
        History._created += 1
        self.run = History._created
        self._signals = plotted_signals(groups)
        self._width = width(self._signals)
        self._stride = max(1, round(1 / (RATE_Hz * period_s)))
        self._bin_s = self._stride * period_s
        self._bins: deque[Bin] = deque(maxlen=round(LENGTH_s * RATE_Hz))
        self._last_command: Array | None = None

    def write(self, first_tick: int, rows: Table) -> None:
        """Add rows, in any chunks."""
        if not len(rows):
            return
        values = plotted_values(rows, self._signals)
        variation = self._variation(rows["current_command_A"].reshape(len(rows), -1))
        numbers = (first_tick + np.arange(len(values))) // self._stride
        starts = np.flatnonzero(np.diff(numbers, prepend=numbers[0] - 1))[-(self._bins.maxlen or 0) :]
        values, variation = values[starts[0] :], variation[starts[0] :]
        starts, numbers = starts - starts[0], numbers[starts]
        low, high = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
        sums = np.add.reduceat(variation, starts)
        for place, number in enumerate(numbers.tolist()):
            new = Bin(number, values[starts[place]].copy(), low[place], high[place], float(sums[place]))
            if self._bins and self._bins[-1].number == number:
                self._bins[-1] = _merged(self._bins[-1], new)
            else:
                self._bins.append(new)

    @property
    def chatter_A_s(self) -> float:
        """Variation of the commanded currents in the last second, mean over the groups, A/s."""
        bins = list(islice(reversed(self._bins), round(CHATTER_s / self._bin_s)))
        return sum(of.variation_A for of in bins) / (len(bins) * self._bin_s) if bins else 0.0

    def read(self, after: int = -1) -> Bins:
        """Return the bins with a number above `after`."""
        bins = [of for of in list(self._bins) if of.number > after]  # a copy: another thread may write
        return Bins(
            self.run,
            [of.number for of in bins],
            self._by_signal([of.row for of in bins]),
            self._by_signal([of.low for of in bins]),
            self._by_signal([of.high for of in bins]),
        )

    def _variation(self, command_A: Array) -> Array:
        before = command_A[:1] if self._last_command is None else self._last_command
        self._last_command = command_A[-1:].copy()
        variation: Array = np.abs(np.diff(command_A, axis=0, prepend=before)).mean(axis=1)
        return variation

    def _by_signal(self, rows: list[Array]) -> dict[str, Array]:
        table = Table(self._signals, np.array(rows).reshape(len(rows), self._width))
        return {signal.name: table[signal.name] for signal in self._signals}


def _merged(first: Bin, second: Bin) -> Bin:
    return Bin(
        first.number,
        first.row,
        np.minimum(first.low, second.low),
        np.maximum(first.high, second.high),
        first.variation_A + second.variation_A,
    )
