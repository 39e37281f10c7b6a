"""Extents of a run's signals, from which ranges and titles of plots follow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, floor, log10
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry.signals import ANGLES, COMMON_NAMES, Signal
from spheretwin.models.telemetry.table import Table

# Extents up to this factor beyond the range of the settled run are drawn completely.
CLIPPED_FROM = 2.5

# Shares of the spans of a run, and of its second half, that the range always contains: a spike is outside.
USUAL, SETTLED = 0.85, 0.98

# Above and below a curve.
MARGIN = 1.1

# Steps of a power of ten, each some 22 pixels high, that a viewer can label in a plot of a small window.
LABELLED = 8

# Halves and ends of ranges with such steps.
_NICE = (1.0, 1.5, 2.0, 3.0, 4.0, 10.0)
NICE_ABOVE_ZERO = (1.0, 1.5, 2.0, 3.0, 10.0)

# Share of a range beyond the greatest labelled number: otherwise half of its height would be cut.
ROOM = 0.06


Corner = Literal["RightTop", "LeftTop", "RightBottom", "LeftBottom"]
"""Corner of a plot, by the name that the viewer gives it."""


class PlotChannel(NamedTuple):
    """Entry of a signal or of a quantity, or all entries."""

    name: str
    place: int | None = None


class CurrentRanges(NamedTuple):
    """Ranges of the colours of maps of the currents, A."""

    mean_A: float
    rms_A: float


class Extents:
    """Bounds of every channel over spans of a run.

    Parameters
    ----------
    t_s : (n,) array
        Start of each span.
    low, high : mapping of name to (n, size) arrays
        Least and greatest value within each; NaN if there is none.
    ended_s : float, optional
        When the run ended before its time.
    currents : CurrentRanges, optional
        Ranges of the maps of the currents.
    has_faults : bool
        Whether the starts of faults are drawn.
    """

    def __init__(
        self,
        t_s: Array,
        low: Mapping[str, Array],
        high: Mapping[str, Array],
        ended_s: float | None,
        currents: CurrentRanges | None = None,
        *,
        has_faults: bool = False,
    ) -> None:
        self.has_faults = has_faults
        self.t_s, self._low, self._high, self.ended_s, self.currents = t_s, low, high, ended_s, currents

    def limit(self, *channels: PlotChannel, least: float, above_zero: bool = False) -> float:
        """Return half of a range about 0, or its end, in which the settled run can be read.

        It contains 98 % of the second half and 85 % of all, or everything if that is not much larger.

        Parameters
        ----------
        *channels : Channel
            Drawn in one plot, or in plots that are compared.
        least : float
            Least range.
        above_zero : bool
            Whether the range begins at 0.
        """
        size = self._largest(*channels)
        second_half = size[self.t_s >= self.t_s[-1] / 2]
        settled = float(np.quantile(second_half, SETTLED, method="lower"))
        usual = max(least, settled, float(np.quantile(size, USUAL)))
        whole = float(np.max(size))
        shown = whole if least < whole <= CLIPPED_FROM * usual else usual
        return nice(MARGIN * shown, NICE_ABOVE_ZERO if above_zero else _NICE)

    def bounds(self, *channels: PlotChannel) -> tuple[float, float]:
        """Return the least and greatest value of some channels."""
        low = min(_least(self._bounds(self._low, channel)) for channel in channels)
        high = max(-_least(-self._bounds(self._high, channel)) for channel in channels)
        return low, high

    def band(self, *channels: PlotChannel, least: float) -> tuple[float, float]:
        """Return the range of some channels, at least twice `least` wide, with two labels."""
        return labelled(*self.bounds(*channels), least)

    def is_cut(self, limit: float, *channels: PlotChannel) -> bool:
        """Return True if magnitudes of some channels are outside of a limit."""
        return bool(np.any(self._largest(*channels) > limit))

    def emptiest_corner(self, band: tuple[float, float], *channels: PlotChannel) -> Corner:
        """Return the corner of a plot with a range into which the lines of some channels reach the least."""
        middle, half = (band[0] + band[1]) / 2, (band[1] - band[0]) / 2
        late = self.t_s > (self.t_s[0] + self.t_s[-1]) / 2

        def reach(of: Mapping[str, Array], sign: float, places: NDArray[np.bool_]) -> float:
            bounds = np.concatenate([self._bounds(of, channel)[places] for channel in channels], axis=1)
            share = sign * (np.nan_to_num(bounds, nan=middle) - middle) / half
            return float(np.sum(np.clip(share, 0.0, 1.0))) / max(1, int(np.count_nonzero(places)))

        reaches: dict[Corner, float] = {
            "LeftTop": reach(self._high, 1.0, ~late),  # the first of equal ones: it leaves the end free
            "RightTop": reach(self._high, 1.0, late),
            "LeftBottom": reach(self._low, -1.0, ~late),
            "RightBottom": reach(self._low, -1.0, late),
        }
        return min(reaches, key=lambda corner: reaches[corner])

    def _largest(self, *channels: PlotChannel) -> Array:
        """Return the largest magnitude among some channels in each span; 0 if there is no number."""
        sizes = np.concatenate([self._size(channel) for channel in channels], axis=1)
        return np.max(np.where(np.isfinite(sizes), sizes, 0.0), axis=1)

    def _size(self, channel: PlotChannel) -> Array:
        return np.maximum(np.abs(self._bounds(self._low, channel)), np.abs(self._bounds(self._high, channel)))

    def _bounds(self, of: Mapping[str, Array], channel: PlotChannel) -> Array:
        values = of[channel.name]
        return values if channel.place is None else values[:, channel.place : channel.place + 1]


def nice(value: float, among: Sequence[float] = _NICE) -> float:
    """Return the least of some numbers of a decade, up to 10 times it, that is not below a positive value."""
    decade = 10.0 ** floor(log10(value))
    return next(step for step in among if step * decade >= value * (1 - 1e-9)) * decade


def number(value: float) -> str:
    """Return a number as text: three digits, and thousands without a power of ten."""
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.3g}"


def labelled(low: float, high: float, least: float, most: int = LABELLED) -> tuple[float, float]:
    """Return a range around two numbers in which a viewer labels two ticks or more.

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
    if last < first:  # no step lies within
        return step * last - room, step * first + room
    below, above = step * (first - 1), step * (last + 1)
    return (below - room, high) if low - below < above - high else (low, above + room)


def _least(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(np.min(finite)) if len(finite) else 0.0


# Beyond twice this number, pairs of neighbours are united.
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

    def extents(
        self, ended_s: float | None, currents: CurrentRanges | None = None, *, has_faults: bool = False
    ) -> Extents | None:
        """Return the extents, if there are rows."""
        if not len(self._t_s):
            return None
        low, high = self._split(self._low), self._split(self._high)
        return Extents(self._t_s, low, high, ended_s, currents, has_faults=has_faults)

    def _split(self, bounds: Array) -> dict[str, Array]:
        ends = np.cumsum(list(self._sizes.values()))[:-1]
        return dict(zip(self._sizes, np.split(bounds, ends, axis=1), strict=True))


def plotted_signals(signals: tuple[Signal, ...]) -> dict[str, int]:
    """Return signals plotted in ranges of the run's own, for which bounds are tracked, with their sizes."""
    return {signal.name: signal.size for signal in signals if not signal.states and not _is_fixed(signal)}


def _is_fixed(signal: Signal) -> bool:
    """Return True for a signal that needs no bounds; a law may give another one the name of one of groups."""
    own = signal.name not in COMMON_NAMES and signal.size <= len(ANGLES)
    return signal.name in _OF_FIXED_RANGE and not own


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
        "current_limited",
        "time_to_detection_s",
    }
)
"""Signals with a fixed range, and those that are not plotted."""


def selected_columns(rows: Table, sizes: Mapping[str, int]) -> list[Array]:
    """Return the columns of some signals in a chunk; NaN if they are missing, after a change of law."""
    names = {signal.name for signal in rows.signals}
    return [
        rows[name].reshape(len(rows), -1) if name in names else np.full((len(rows), size), np.nan)
        for name, size in sizes.items()
    ]
