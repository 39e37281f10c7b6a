"""Colours: one for each axis, each law and each coil group, and a scale for signed currents."""

import colorsys
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Colour = tuple[int, int, int]
Dash = str | tuple[int, tuple[int, ...]]

AXIS_COLOURS: tuple[Colour, ...] = ((235, 87, 87), (76, 190, 120), (86, 140, 245))
"""α or x, β or y, γ or z."""

BACKGROUND: Colour = (20, 22, 26)
TRACE: Colour = (255, 190, 60)
NORTH: Colour = (150, 155, 163)
SOUTH: Colour = (44, 47, 54)
COIL_TORQUE: Colour = (224, 92, 178)
LOAD: Colour = (26, 168, 160)
PAYLOAD: Colour = (26, 168, 160)
"""Weight on the shaft, and its torque."""
DESIRED_TRACE: Colour = (130, 136, 146)

COMMAND: Colour = (240, 240, 240)
"""Commands and references, drawn thin over the actual values."""

PLAIN: Colour = (200, 204, 212)
"""Lines of no axis and no current."""

GROUP: Colour = (160, 130, 110)
"""Each of many coil groups, where only their spread matters."""

ESTIMATE: Colour = (255, 190, 60)
"""Measurements, estimates and predictions of the controller."""

FINE: Colour = (48, 84, 70)
WARNING: Colour = (214, 140, 30)
FAILURE: Colour = (205, 60, 150)
"""States; red is an axis, and a current."""

LAW_COLOURS: dict[str, str] = {
    "pd": "#0072b2",
    "pid": "#e69f00",
    "lqi": "#8c3315",
    "computed_torque": "#2d00b2",
    "backstepping_sliding_mode": "#ffa6ff",
    "adrc": "#400040",
    "super_twisting": "#426654",
    "adaptive_fuzzy": "#009e73",
    "afsm": "#d55e00",
    "afsm_eso": "#000000",
}
"""Colours of the shipped laws by name, distinct for the colour-blind and by their lightness in grey.

Okabe and Ito's for the paper's laws and PID; the others are where these leave most room.
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

OTHER_LAW = "#8a5a9e"

SPARE = ("#56b4e9", "#cc79a7", "#7a7a1a", "#30343a", "#a65628")
"""Colours for laws whose own colour is in use."""

_SPARE_MARKS: tuple[tuple[str, Dash], ...] = (
    ("p", (0, (2, 1))),
    ("h", (0, (6, 1, 1, 1))),
    ("d", (0, (4, 4))),
    ("8", "-"),
    ("H", "--"),
)

_NEGATIVE, _IDLE, _POSITIVE = (60, 130, 255), (150, 110, 84), (255, 70, 50)


def mixed(colour: Colour, other: Colour, share: float) -> Colour:
    """A colour with a share of another."""
    red, green, blue = (
        round((1 - share) * own + share * its) for own, its in zip(colour, other, strict=True)
    )
    return red, green, blue


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


def law_marks(laws: Sequence[str]) -> dict[str, tuple[str, Dash]]:
    """Return marker and dash for each law: those of its name, or spare ones."""
    spare = iter(_SPARE_MARKS)
    return {law: LAW_MARKS.get(law) or next(spare, _SPARE_MARKS[-1]) for law in laws}


def group_colours(count: int) -> list[Colour]:
    """Evenly spaced hues."""
    return [_rgb(j / count) for j in range(count)]


def current_colours(current: NDArray[np.float64], limit: float) -> NDArray[np.uint8]:
    """Colour of signed currents: blue for negative, copper when idle, red for positive.

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
    # The root shows small currents, which are most of them.
    share = np.sqrt(np.clip(np.abs(current) / limit, 0, 1))[..., None]
    full = np.where(current[..., None] < 0, _NEGATIVE, _POSITIVE)
    return np.round((1 - share) * np.array(_IDLE) + share * full).astype(np.uint8)


def _rgb(hue: float) -> Colour:
    red, green, blue = colorsys.hsv_to_rgb(hue, 0.6, 0.95)
    return round(255 * red), round(255 * green), round(255 * blue)
