"""Colours: one for each axis, each law and each role, and a scale for signed currents.

Lines are drawn on the grounds of the viewer's dark and light theme, and on pages.
Their colours have a contrast of at least 3:1 to each of these (WCAG 2), and differ for colour-blind readers.
"""

import colorsys
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Colour = tuple[int, int, int]
Dash = str | tuple[int, tuple[int, ...]]

AXIS_COLOURS: tuple[Colour, ...] = ((208, 16, 8), (0, 166, 132), (112, 60, 240))
"""α or x, β or y, γ or z: red, teal green, violet blue.

The CIE76 difference of any two is at least 40 under deuteranopia, protanopia and tritanopia.
"""

TRACE: Colour = (230, 112, 20)
NORTH: Colour = (150, 155, 163)
SOUTH: Colour = (44, 47, 54)
COIL_TORQUE: Colour = (152, 80, 72)
LOAD: Colour = (184, 136, 80)
PAYLOAD: Colour = (184, 136, 80)
"""Weight on the shaft, and its torque."""
DESIRED_TRACE: Colour = (168, 136, 184)
"""Path of the desired tip, and secondary lines: mauve."""

COMMAND: Colour = (110, 101, 104)
"""Commands and references, drawn thin over the actual values: grey."""

PLAIN: Colour = (124, 146, 136)
"""Lines of no axis and no current."""

GROUP: Colour = (150, 116, 84)
"""Each of many coil groups, where only their spread matters."""

ESTIMATE: Colour = (230, 112, 20)
"""Measurements, estimates and predictions of the controller: orange."""

FINE: Colour = (64, 120, 120)
WARNING: Colour = (176, 120, 72)
FAILURE: Colour = (232, 40, 216)
"""States; red is an axis, and a current."""

LAW_COLOURS: dict[str, str] = {
    "pd": "#0098f0",
    "pid": "#c88000",
    "lqi": "#b88880",
    "computed_torque": "#8050b0",
    "backstepping_sliding_mode": "#ff38a8",
    "adrc": "#b000ff",
    "super_twisting": "#587048",
    "adaptive_fuzzy": "#70a050",
    "afsm": "#a84810",
    "afsm_eso": "#407888",
}
"""Colours of the shipped laws by name: of no axis, no command and no state.

Within the contrasts of this module, these ten differ most for normal and colour-blind sight.
"""

LAW_MARKS: dict[str, tuple[str, Dash]] = {
    "pd": ("o", ":"),
    "pid": ("D", "-."),
    "lqi": ("v", (0, (5, 1))),
    "computed_torque": ("P", (0, (1, 1))),
    "backstepping_sliding_mode": ("X", (0, (3, 1, 1, 1))),
    "adrc": ("<", (0, (7, 2))),
    "super_twisting": (">", (0, (3, 1, 1, 1, 1, 1))),
    "adaptive_fuzzy": ("s", "--"),
    "afsm": ("^", "-"),
    "afsm_eso": ("*", (0, (9, 1))),
}
"""Marker and dash of the same laws, in Matplotlib's notation: they are distinct in grey print."""

OTHER_LAW = "#904898"

SPARE = ("#e85838", "#a800d0", "#c80838", "#c06060", "#2060ff")
"""Colours for laws whose own colour is in use."""

_SPARE_MARKS: tuple[tuple[str, Dash], ...] = (
    ("p", (0, (2, 1))),
    ("h", (0, (6, 1, 1, 1))),
    ("d", (0, (4, 4))),
    ("8", "-"),
    ("H", "--"),
)

_NO_CURRENT, _FULL_CURRENT = (96, 96, 96), (230, 190, 40)

_NEGATIVE, _ZERO, _POSITIVE = (48, 112, 224), (128, 128, 128), (230, 76, 24)


def mixed(colour: Colour, other: Colour, share: float) -> Colour:
    """A colour with a share of another."""
    red, green, blue = (
        round((1 - share) * own + share * its) for own, its in zip(colour, other, strict=True)
    )
    return red, green, blue


def rgb(colour: str) -> Colour:
    """Return a page's colour as red, green, blue."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red, green, blue


def label_colour(colour: Colour) -> Colour:
    """Return a colour for a label of the scene, mixed with white.

    It has a contrast of 4.5:1 to the dark ground of labels and of 3:1 to a white one. None has 4.5:1 to both.
    """
    shares = (mixed(colour, (255, 255, 255), share / 100) for share in range(101))
    return next(shade for shade in shares if _luminance(shade) >= _READABLE)


def text_colour(colour: str) -> str:
    """Return a page's colour for text on white paper, mixed with black to a contrast of 4.5:1."""
    shades = (mixed(rgb(colour), (0, 0, 0), share / 100) for share in range(101))
    return "#{:02x}{:02x}{:02x}".format(*next(shade for shade in shades if _luminance(shade) <= _DARK))


def law_colour(law: str) -> str:
    """Return the colour of a law for a page; one colour for all laws without their own."""
    return LAW_COLOURS.get(law, OTHER_LAW)


def law_colours(laws: Sequence[str]) -> dict[str, str]:
    """A colour for each of some laws: its own by its name, or one that is left where that is taken."""
    colours: dict[str, str] = {}
    for law in laws:
        own = law_colour(law.split(",")[0])
        others = [colour for colour in (own, *SPARE) if colour not in colours.values()]
        colours[law] = others[0] if others else own
    return colours


def run_colours(laws: Sequence[str]) -> list[str]:
    """Return a colour for each run, as a page writes it: no two are the same.

    The first run of a law has the law's own colour; another one has a spare colour, then that of a law
    without a run.

    Parameters
    ----------
    laws : sequence of str
        Law of each run.
    """
    own = [law_colour(law) for law in laws]
    spare = [colour for colour in (*SPARE, *LAW_COLOURS.values(), OTHER_LAW) if colour not in own]
    if len({*own, *spare}) < len(laws):
        return _spaced_hues(len(laws))
    colours: list[str] = []
    for colour in own:
        colours.append(spare.pop(0) if colour in colours else colour)
    return colours


_LUMINANCE = (0.2126, 0.7152, 0.0722)
_READABLE = 0.275
_DARK = 0.183
"""Greatest luminance of a text with a contrast of 4.5:1 to white."""


def _luminance(colour: Colour) -> float:
    return float(linear_light(np.array(colour) / 255) @ _LUMINANCE)


def linear_light(shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the light of a screen's numbers (sRGB), 0 to 1."""
    return np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)


_MIDDLE = 0.2
"""Share of white's luminance: it has a contrast of 4:1 to black and to white."""


def _spaced_hues(count: int) -> list[str]:
    """Return colours of evenly spaced hues and one luminance."""
    lightness = np.linspace(0.2, 0.8, 200)
    colours = []
    for place in range(count):
        shares = np.array([colorsys.hls_to_rgb(place / count, value, 0.8) for value in lightness])
        middle = shares[np.searchsorted(linear_light(shares) @ _LUMINANCE, _MIDDLE)]
        colours.append("#{:02x}{:02x}{:02x}".format(*np.round(255 * middle).astype(int)))
    return colours


def law_marks(laws: Sequence[str]) -> dict[str, tuple[str, Dash]]:
    """Return marker and dash for each law: those of its name, or spare ones."""
    spare = iter(_SPARE_MARKS)
    return {law: LAW_MARKS.get(law) or next(spare, _SPARE_MARKS[-1]) for law in laws}


def current_colours(current: NDArray[np.floating], limit: float) -> NDArray[np.uint8]:
    """Return the colours of signed currents on a linear scale: blue negative, grey zero, orange-red positive.

    Parameters
    ----------
    current : (...) array, A
        Any shape.
    limit : float, A
        Current of the full colour.

    Returns
    -------
    (..., 3) uint8 array
        Red, green, blue.
    """
    share = np.clip(current / limit, -1, 1)
    negative, positive = np.minimum(share, 0), np.maximum(share, 0)
    colours = np.empty((*share.shape, 3), np.uint8)
    for channel, (low, zero, high) in enumerate(zip(_NEGATIVE, _ZERO, _POSITIVE, strict=True)):
        colours[..., channel] = np.rint(zero + (zero - low) * negative + (high - zero) * positive)
    return colours


def magnitude_colours(magnitude: NDArray[np.float64], limit: float) -> NDArray[np.uint8]:
    """Return the colours of magnitudes of currents on a linear scale: grey zero, yellow the limit.

    Parameters
    ----------
    magnitude : (...) array, A
        Any shape.
    limit : float, A
        Current of the full colour.

    Returns
    -------
    (..., 3) uint8 array
        Red, green, blue.
    """
    share = np.clip(magnitude / limit, 0, 1)[..., None]
    return np.round((1 - share) * np.array(_NO_CURRENT) + share * np.array(_FULL_CURRENT)).astype(np.uint8)
