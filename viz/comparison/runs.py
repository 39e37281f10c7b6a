"""A run among others, as those who draw it need it."""

from __future__ import annotations

import colorsys
import math
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.status import Level
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import theme
from spheretwin.viz.quantities import QuantityRows

Event = tuple[float, Level, str]
"""Simulated time in s, level, text."""


class ComparedRun(NamedTuple):
    """One run."""

    name: str
    """What tells it from the others where there is room for a word: ``run_1_nutation``."""
    label: str
    """What a legend says: file, law, what else is not the same in all."""
    law: str
    period_s: float
    """Between two rows."""
    rows: QuantityRows
    """Its telemetry, with a row at least, and what is derived from it needs beside it."""
    record: Mapping[str, str]
    """What its telemetry file says of it beside the rows."""
    events: Sequence[Event]

    @property
    def table(self) -> Table:
        """Its telemetry."""
        return self.rows.table


# Of what the eye makes of white: a line of less is lost on a dark ground.
DARKEST = 0.15
# What has no hue becomes almost white there: grey is what was asked for.
HUELESS, WHITE = 0.15, 0.92
# Of 441 from black to white: colours nearer to each other are taken for one.
APART = 25.0

_LUMINANCE = (0.2126, 0.7152, 0.0722)
_STEP = 0.005


def run_colours(laws: Sequence[str]) -> list[str]:
    """A colour for each of some runs, as a page writes it: no two are the same.

    The first of a law has the law's own; another has, of the spare ones, the farthest from all before it.

    Parameters
    ----------
    laws : sequence of str
        Of each run.
    """
    own = [theme.law_colour(law) for law in laws]
    colours: list[str] = []
    for colour in own:
        taken = {*colours, *own}
        spare = [candidate for candidate in theme.SPARE if _nearest(candidate, taken) > APART]
        if colour in colours and not spare:
            return ["#{:02x}{:02x}{:02x}".format(*hue) for hue in theme.group_colours(len(laws))]
        colours.append(
            max(spare, key=lambda candidate: _nearest(candidate, taken)) if colour in colours else colour
        )
    return colours


def on_dark(colour: str) -> theme.Colour:
    """A page's colour for a dark ground: as it is, or no lighter than is seen there."""
    red, green, blue = (value / 255 for value in bytes.fromhex(colour.removeprefix("#")))
    hue, lightness, saturation = colorsys.rgb_to_hls(red, green, blue)
    if saturation < HUELESS:
        return _bytes(WHITE, WHITE, WHITE)
    while _luminance(red, green, blue) < DARKEST:
        lightness += _STEP
        red, green, blue = colorsys.hls_to_rgb(hue, lightness, saturation)
    return _bytes(red, green, blue)


def _luminance(*shares: float) -> float:
    """Share of white's, of red, green and blue as a screen has them."""
    linear = (share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4 for share in shares)
    return sum(weight * share for weight, share in zip(_LUMINANCE, linear, strict=True))


def _nearest(colour: str, others: Collection[str]) -> float:
    return min(math.dist(on_dark(colour), on_dark(other)) for other in others)


def _bytes(red: float, green: float, blue: float) -> theme.Colour:
    return round(255 * red), round(255 * green), round(255 * blue)


# Times of ticks at different rates are products that differ in their last bits, and angles with them.
SAME_rad = 1e-9


def leaders(tables: Sequence[Table]) -> list[int]:
    """Places of the runs that show each desired motion longest, in order.

    Parameters
    ----------
    tables : sequence of Table
        With a row each at least.
    """
    leading: list[int] = []
    for place in sorted(range(len(tables)), key=lambda place: -float(tables[place]["t_s"][-1])):
        if not any(_same(tables[place], tables[leader]) for leader in leading):
            leading.append(place)
    return sorted(leading)


def _same(one: Table, other: Table) -> bool:
    """Whether two were asked for the same at all ticks that they have in common."""
    t_ns, others_ns = (np.round(table["t_s"] * 1e9).astype(np.int64) for table in (one, other))
    _, rows, others = np.intersect1d(t_ns, others_ns, assume_unique=True, return_indices=True)
    apart = np.abs(one["q_ref_rad"][rows] - other["q_ref_rad"][others])
    return bool(apart.max(initial=0.0) <= SAME_rad)


Array = NDArray[np.float64]


class Spectrum(NamedTuple):
    """Of one run's tracking error about one hinge."""

    frequency_Hz: Array  # (n,) above zero
    amplitude_mrad: Array  # (n,)
    peaks: Sequence[tuple[float, float]]
    """Frequency in Hz and amplitude in mrad of the strongest."""
