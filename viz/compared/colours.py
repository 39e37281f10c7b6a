"""A colour a run: that of its law, and others where several fly the same one."""

from __future__ import annotations

import colorsys
import math
from collections.abc import Collection, Sequence

from spheretwin.viz import palette

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
    own = [palette.law_colour(law) for law in laws]
    found: list[str] = []
    for colour in own:
        taken = {*found, *own}
        spare = [each for each in palette.SPARE if _nearest(each, taken) > APART]
        if colour in found and not spare:
            return ["#{:02x}{:02x}{:02x}".format(*hue) for hue in palette.group_colours(len(laws))]
        found.append(max(spare, key=lambda each: _nearest(each, taken)) if colour in found else colour)
    return found


def on_dark(colour: str) -> palette.Colour:
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


def _bytes(red: float, green: float, blue: float) -> palette.Colour:
    return round(255 * red), round(255 * green), round(255 * blue)
