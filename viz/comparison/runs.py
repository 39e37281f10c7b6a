"""Runs of a comparison: their data, colours, references and spectra."""

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
    """Run of a comparison."""

    name: str
    """Unique short name: ``run_1_nutation``."""
    label: str
    """Text of a legend: file, law, and the differing fields."""
    law: str
    period_s: float
    """Period of the rows."""
    rows: QuantityRows
    """Telemetry with at least one row, and the parameters of derived quantities."""
    record: Mapping[str, str]
    """Metadata of its telemetry file."""
    events: Sequence[Event]

    @property
    def table(self) -> Table:
        """Its telemetry."""
        return self.rows.table


# Share of white's luminance: darker lines are invisible on a dark ground.
DARKEST = 0.15
# Colours without a hue become almost white there: grey is the reference.
HUELESS, WHITE = 0.15, 0.92
# Of 441 from black to white: nearer colours cannot be distinguished.
APART = 25.0

_LUMINANCE = (0.2126, 0.7152, 0.0722)
_STEP = 0.005


def run_colours(laws: Sequence[str]) -> list[str]:
    """A colour for each of some runs, as a page writes it: no two are the same.

    The first of a law has the law's own; another has, of the spare ones, the farthest from all before it.

    Parameters
    ----------
    laws : sequence of str
        Law of each run.
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
    """Return a page's colour for a dark ground: unchanged, or lightened until it is visible."""
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
    """True if two runs have the same reference at all common ticks."""
    t_ns, others_ns = (np.round(table["t_s"] * 1e9).astype(np.int64) for table in (one, other))
    _, rows, others = np.intersect1d(t_ns, others_ns, assume_unique=True, return_indices=True)
    apart = np.abs(one["q_ref_rad"][rows] - other["q_ref_rad"][others])
    return bool(apart.max(initial=0.0) <= SAME_rad)


Array = NDArray[np.float64]


class Spectrum(NamedTuple):
    """Spectrum of one run's tracking error about one hinge."""

    frequency_Hz: Array  # (n,) above zero
    amplitude_mrad: Array  # (n,)
    peaks: Sequence[tuple[float, float]]
    """Frequency in Hz and amplitude in mrad of the strongest."""
