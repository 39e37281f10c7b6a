"""Random numbers of the electronics: rows of standard normal ones, counted by control tick."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

STAGE, FAULTS = 3, 4
"""Of the streams, of the sensors and of faults: ``SeedSequence([seed, stage, block of columns])``."""

# The generator counts in blocks of four numbers, of which a tick takes one.
NUMBERS_A_COUNT = 4


def noise_rows(seed: int, first: int, ticks: int, width: int, stage: int = STAGE) -> NDArray[np.float64]:
    """Standard normal numbers at consecutive control ticks.

    A stream of its own for every four columns, counted by tick: each number depends on seed, tick and column
    alone. Neither blocks of ticks nor further columns move a bit, and no state is left behind. The four come
    from four uniform numbers by Box and Muller's transform, which takes as many as it gives: the usual
    ziggurat takes more now and then, and could not be counted.

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
    stage : int
        Whose streams.

    Returns
    -------
    (ticks, width) array
        At most 8.6 in magnitude: the uniform numbers are multiples of 2⁻⁵³.
    """
    rows = np.empty((ticks, width))
    for block, column in enumerate(range(0, width, NUMBERS_A_COUNT)):
        counted = np.random.Philox(np.random.SeedSequence([seed, stage, block])).advance(first)
        uniform = np.random.Generator(counted).random((ticks, NUMBERS_A_COUNT))
        rows[:, column : column + NUMBERS_A_COUNT] = _normal(uniform)[:, : width - column]
    return rows


def _normal(uniform: NDArray[np.float64]) -> NDArray[np.float64]:
    """Independent standard normal numbers (n, 4) from uniform ones from 0 to below 1."""
    radius = np.sqrt(-2 * np.log1p(-uniform[:, :2]))
    angle = 2 * np.pi * uniform[:, 2:]
    return np.concatenate([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
