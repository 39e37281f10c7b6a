"""Random numbers of the electronics: rows of standard normal ones, counted by control tick."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spheretwin.twin.electronics.streams import stream_key

# The generator counts in blocks of four numbers, of which a tick takes one.
NUMBERS_A_COUNT = 4


Streams = tuple[tuple[str, int], ...]
"""Names of random streams, and how many numbers a tick each of them gives."""


def width_of(streams: Streams) -> int:
    """Return how many numbers a tick some streams give together."""
    return sum(width for _, width in streams)


def noise_table(seed: int, first: int, ticks: int, streams: Streams) -> NDArray[np.float64]:
    """Return the numbers of some streams, (ticks, width), one stream next to the other."""
    rows = [noise_rows(seed, first, ticks, width, name) for name, width in streams]
    return np.ascontiguousarray(np.concatenate([np.empty((ticks, 0)), *rows], axis=1))


def noise_rows(seed: int, first: int, ticks: int, width: int, name: str) -> NDArray[np.float64]:
    """Standard normal numbers at consecutive control ticks.

    Every four columns have a stream ``SeedSequence([seed, stream_key(name), block])``, counted by tick:
    each number depends on seed, name, tick and column alone. Neither blocks of ticks nor further columns
    move a bit, and no state is left behind. The four come from four uniform numbers by Box and Muller's
    transform, which takes as many as it gives: the usual ziggurat takes more now and then, and could not be
    counted.

    Parameters
    ----------
    seed : int
        Seed of the run.
    first : int
        First tick.
    ticks : int
        How many.
    width : int
        Numbers a tick.
    name : str
        Of the stream.

    Returns
    -------
    (ticks, width) array
        At most 8.6 in magnitude: the uniform numbers are multiples of 2⁻⁵³.
    """
    rows, key = np.empty((ticks, width)), stream_key(name)
    for block, column in enumerate(range(0, width, NUMBERS_A_COUNT)):
        counted = np.random.Philox(np.random.SeedSequence([seed, key, block])).advance(first)
        uniform = np.random.Generator(counted).random((ticks, NUMBERS_A_COUNT))
        rows[:, column : column + NUMBERS_A_COUNT] = _normal(uniform)[:, : width - column]
    return rows


def _normal(uniform: NDArray[np.float64]) -> NDArray[np.float64]:
    """Independent standard normal numbers (n, 4) from uniform ones from 0 to below 1."""
    radius = np.sqrt(-2 * np.log1p(-uniform[:, :2]))
    angle = 2 * np.pi * uniform[:, 2:]
    return np.concatenate([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
