"""Random numbers of a run: one uniform draw a control tick for each that needs them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# The generator counts in blocks of four numbers, of which a tick takes the first.
NUMBERS_A_COUNT = 4


class Draws(NamedTuple):
    """Uniform numbers from 0 to 1 at some control ticks, (n,) each."""

    paper: Array
    """What the paper's r is made of."""
    of_term: Callable[[int], Array]
    """Those of a term, by its place among the terms."""


def term_draws(seed: int, first: int, ticks: int, place: int) -> Array:
    """Draws of one term at consecutive control ticks.

    A stream of its own for each seed and place, whose numbers are counted by tick: they are the same in any
    order and any block, and leave no state behind.

    Parameters
    ----------
    seed : int
        Seed of the run.
    first : int
        First tick.
    ticks : int
        How many.
    place : int
        Place of the term among the terms.

    Returns
    -------
    (ticks,) array
        Uniform numbers from 0 to 1.
    """
    counted = np.random.Philox(np.random.SeedSequence(seed, spawn_key=(place,))).advance(first)
    numbers = np.random.Generator(counted).random(NUMBERS_A_COUNT * ticks)
    return numbers[::NUMBERS_A_COUNT].copy()
