"""A colour a run: that of its law, and others where several fly the same one."""

from __future__ import annotations

import colorsys
import math
from collections.abc import Collection, Sequence

from spheretwin.viz import palette

# Every lightness moves into the upper part of the scale, and keeps its order. What has no hue becomes almost
# white: grey is what was asked for.
DARKEST, HUELESS, WHITE = 0.5, 0.15, 0.92


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
        spare = [each for each in palette.SPARE if each not in taken]
        if colour in found and not spare:
            return ["#{:02x}{:02x}{:02x}".format(*hue) for hue in palette.group_colours(len(laws))]
        found.append(_farthest(spare, taken) if colour in found else colour)
    return found


def on_dark(colour: str) -> palette.Colour:
    """A page's colour for a dark ground."""
    red, green, blue = (value / 255 for value in bytes.fromhex(colour.removeprefix("#")))
    hue, lightness, saturation = colorsys.rgb_to_hls(red, green, blue)
    lighter = DARKEST + (1 - DARKEST) * lightness if saturation > HUELESS else WHITE
    red, green, blue = colorsys.hls_to_rgb(hue, lighter, saturation)
    return round(255 * red), round(255 * green), round(255 * blue)


def _farthest(spare: Sequence[str], taken: Collection[str]) -> str:
    return max(spare, key=lambda each: min(math.dist(on_dark(each), on_dark(other)) for other in taken))
