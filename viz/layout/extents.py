"""What a run has shown, from which ranges and titles of plots are made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, floor, log10
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.signals import Signal, offsets
from spheretwin.models.telemetry.table import Table

Array = NDArray[np.float64]

# What goes less far beyond the range in which the settled run can be read is drawn whole.
CLIPPED_FROM = 2.5

# Of the spans of a run, those that are within its range wherever they are.
USUAL = 0.85

# Above and below a curve.
MARGIN = 1.1

# A viewer labels steps of a power of ten, each some 22 pixels high: in a plot of a small window so many.
LABELLED = 8

# Halves and ends of ranges in which there are such steps.
_NICE = (1.0, 1.5, 2.0, 3.0, 4.0, 10.0)
_NICE_ABOVE_ZERO = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 10.0)

# Of a range, beyond the greatest number that is labelled: half of its height would be cut.
ROOM = 0.06


class PlotChannel(NamedTuple):
    """One entry of a signal or of a quantity, or all of them."""

    name: str
    place: int | None = None


class Extents:
    """Bounds of every channel over spans of a run.

    Parameters
    ----------
    t_s : (n,) array
        Start of each span.
    low, high : mapping of name to (n, size) arrays
        Least and greatest value within each; NaN where there was none.
    ended_s : float, optional
        When the run ended before its time.
    """

    def __init__(
        self, t_s: Array, low: Mapping[str, Array], high: Mapping[str, Array], ended_s: float | None
    ) -> None:
        self.t_s, self._low, self._high, self.ended_s = t_s, low, high, ended_s

    def limit(self, *channels: PlotChannel, least: float, above_zero: bool = False) -> float:
        """Half of a range about 0, or its end, in which the run can be read once it has settled.

        It holds the whole second half and 85 % of all, or everything where that is not much more.

        Parameters
        ----------
        *channels : Channel
            Drawn in one plot, or in plots that are compared.
        least : float
            What the range never falls below.
        above_zero : bool
            Whether the range begins at 0.
        """
        size = self._largest(*channels)
        second_half = size[self.t_s >= self.t_s[-1] / 2]
        usual = max(least, float(np.max(second_half)), float(np.quantile(size, USUAL)))
        whole = float(np.max(size))
        shown = whole if least < whole <= CLIPPED_FROM * usual else usual
        return nice(MARGIN * shown, _NICE_ABOVE_ZERO if above_zero else _NICE)

    def bounds(self, *channels: PlotChannel) -> tuple[float, float]:
        """Least and greatest of all that some channels have shown."""
        low = min(_least(self._bounds(self._low, channel)) for channel in channels)
        high = max(-_least(-self._bounds(self._high, channel)) for channel in channels)
        return low, high

    def band(self, *channels: PlotChannel, least: float) -> tuple[float, float]:
        """Range of all that some channels have shown, at least twice `least` wide, with two labels."""
        return labelled(*self.bounds(*channels), least)

    def largest(self, limit: float, *channels: PlotChannel) -> str:
        """What the title of a plot says of its largest magnitude, and when it lies outside of the range."""
        size = self._largest(*channels)
        outside = np.flatnonzero(size > limit)
        text = f", largest {number(float(np.max(size)))}"
        if not len(outside):
            return text
        until = self.t_s[min(outside[-1] + 1, len(self.t_s) - 1)]
        return f"{text} in first {until:.2g} s"

    def _largest(self, *channels: PlotChannel) -> Array:
        """Largest magnitude among some channels in each span; 0 where there was no number."""
        sizes = np.concatenate([self._size(channel) for channel in channels], axis=1)
        return np.max(np.where(np.isfinite(sizes), sizes, 0.0), axis=1)

    def _size(self, channel: PlotChannel) -> Array:
        return np.maximum(np.abs(self._bounds(self._low, channel)), np.abs(self._bounds(self._high, channel)))

    def _bounds(self, of: Mapping[str, Array], channel: PlotChannel) -> Array:
        values = of[channel.name]
        return values if channel.place is None else values[:, channel.place : channel.place + 1]


def nice(value: float, among: Sequence[float] = _NICE) -> float:
    """The least of some numbers of a decade, up to 10 of it, that is not below a positive value."""
    decade = 10.0 ** floor(log10(value))
    return next(step for step in among if step * decade >= value * (1 - 1e-9)) * decade


def number(value: float) -> str:
    """Three digits, and thousands without a power of ten."""
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.3g}"


def labelled(low: float, high: float, least: float, most: int = LABELLED) -> tuple[float, float]:
    """Range around two numbers in which a viewer labels two ticks or more.

    Parameters
    ----------
    low, high : float
    least : float
        Half of the range at least, above zero.
    most : int
        Steps for which the plot is high enough.
    """
    middle, half = (low + high) / 2, max(least, MARGIN * (high - low) / 2)
    low, high = middle - half, middle + half
    step = 10.0 ** ceil(log10((high - low) / most))
    first, last = ceil(low / step), floor(high / step)
    room = ROOM * (high - low)
    if last > first:
        return low, high
    if last < first:  # none lies within
        return step * last - room, step * first + room
    below, above = step * (first - 1), step * (last + 1)
    return (below - room, high) if low - below < above - high else (low, above + room)


def _least(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(np.min(finite)) if len(finite) else 0.0


# Beyond twice as many, two neighbours become one.
SPANS = 512


class ExtentTracker:
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

    def extents(self, ended_s: float | None) -> Extents | None:
        """All of it, once there is some."""
        if not len(self._t_s):
            return None
        return Extents(self._t_s, self._split(self._low), self._split(self._high), ended_s)

    def _split(self, bounds: Array) -> dict[str, Array]:
        ends = np.cumsum(list(self._sizes.values()))[:-1]
        return dict(zip(self._sizes, np.split(bounds, ends, axis=1), strict=True))


def plotted_signals(signals: tuple[Signal, ...]) -> dict[str, int]:
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


class ColumnSelector:
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
        columns = np.array(places, dtype=np.int64)
        self._places, self._missing = np.maximum(columns, 0), np.flatnonzero(columns < 0)
