"""What a run has shown, from which ranges and titles of plots are made."""

from __future__ import annotations

from collections.abc import Mapping
from math import floor, log10
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# What goes less far beyond the range in which the settled run can be read is drawn whole.
CLIPPED_FROM = 2.5

# Of the spans of a run, those that are within its range wherever they are.
USUAL = 0.85

# Above and below a curve.
MARGIN = 1.1

_NICE = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)


class Channel(NamedTuple):
    """One entry of a signal or of a quantity, or all of them."""

    name: str
    place: int | None = None


class Seen:
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

    def limit(self, *channels: Channel, least: float) -> float:
        """Half of a range about 0 in which the run can be read once it has settled.

        It holds the whole second half and 85 % of all, or everything where that is not much more.

        Parameters
        ----------
        *channels : Channel
            Drawn in one plot, or in plots that are compared.
        least : float
            What the range never falls below.
        """
        size = self._largest(*channels)
        second_half = size[self.t_s >= self.t_s[-1] / 2]
        usual = max(least, float(np.max(second_half)), float(np.quantile(size, USUAL)))
        whole = float(np.max(size))
        return nice(MARGIN * (whole if least < whole <= CLIPPED_FROM * usual else usual))

    def band(self, *channels: Channel, least: float) -> tuple[float, float]:
        """Range of all that some channels have shown, at least twice `least` wide."""
        low = min(_least(self._bounds(self._low, channel)) for channel in channels)
        high = max(-_least(-self._bounds(self._high, channel)) for channel in channels)
        middle, half = (low + high) / 2, max(least, MARGIN * (high - low) / 2)
        return middle - half, middle + half

    def beyond(self, limit: float, *channels: Channel) -> str:
        """What the title of a plot says of what lies outside of its range; nothing if all lies within."""
        size = self._largest(*channels)
        outside = np.flatnonzero(size > limit)
        if not len(outside):
            return ""
        until = self.t_s[min(outside[-1] + 1, len(self.t_s) - 1)]
        return f", to {np.max(size):.3g} in first {until:.2g} s"

    def _largest(self, *channels: Channel) -> Array:
        """Largest magnitude among some channels in each span; 0 where there was no number."""
        sizes = np.concatenate([self._size(each) for each in channels], axis=1)
        return np.max(np.where(np.isfinite(sizes), sizes, 0.0), axis=1)

    def _size(self, channel: Channel) -> Array:
        return np.maximum(np.abs(self._bounds(self._low, channel)), np.abs(self._bounds(self._high, channel)))

    def _bounds(self, of: Mapping[str, Array], channel: Channel) -> Array:
        values = of[channel.name]
        return values if channel.place is None else values[:, channel.place : channel.place + 1]


def nice(value: float) -> float:
    """The least short number that is not below a positive one."""
    decade = 10.0 ** floor(log10(value))
    return next(each for each in _NICE if each * decade >= value * (1 - 1e-9)) * decade


def _least(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(np.min(finite)) if len(finite) else 0.0
