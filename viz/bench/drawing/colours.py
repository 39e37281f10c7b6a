"""Colours as a page has to be told them, for it to show what was meant.

The page lights a surface, then presses all light into what a screen can show, by the ACES curve in Stephen
Hill's fit: a colour that is told as it is comes out pale. So what is told is what the curve makes the colour
of, on a surface that has `LIGHT` of it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

LIGHT = 1.6
"""Light of a surface that is seen in its own colour, as a multiple of what a white one needs to be white."""

# The curve comes to its end far away: nobody sees the difference, and a bright colour stays a colour.
BRIGHTEST = 0.9

_EXPOSURE = 1 / 0.6
_INTO = np.array([[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]])
_OUT_OF = np.array(
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]
)


def of_instances(colours: ArrayLike) -> NDArray[np.uint8]:
    """Colours of many copies of a solid, (..., 3), which a page takes for shares of light."""
    return np.round(255 * _albedo(colours)).astype(np.uint8)


def of_one(colour: ArrayLike) -> tuple[int, int, int]:
    """Colour of one solid, which a page takes as a screen does."""
    red, green, blue = np.round(255 * _encoded(_albedo(colour))).astype(int).tolist()
    return red, green, blue


def _albedo(colours: ArrayLike) -> NDArray[np.float64]:
    """Share of the light that a surface gives back, (..., 3)."""
    shown = np.clip(_linear(np.asarray(colours) / 255) @ np.linalg.inv(_OUT_OF).T, 0.0, BRIGHTEST)
    # v (v + 0.0245786) - 0.000090537 = shown (v (0.983729 v + 0.4329510) + 0.238081)
    a, b, c = (
        1 - 0.983729 * shown,
        0.0245786 - 0.4329510 * shown,
        -0.000090537 - 0.238081 * shown,
    )
    before = (-b + np.sqrt(b**2 - 4 * a * c)) / (2 * a)
    return np.clip(before @ np.linalg.inv(_INTO).T / (_EXPOSURE * LIGHT), 0.0, 1.0)


def _linear(encoded: NDArray[np.float64]) -> NDArray[np.float64]:
    """Light of a screen's numbers (sRGB), 0 to 1."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def _encoded(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
