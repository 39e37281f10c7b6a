"""Columns of many rows as few numbers, in which nothing that stands out is lost."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Thinned(NamedTuple):
    """Numbers at equal distances."""

    values: Array  # (m,)
    rows_each: float
    """Rows that one of them stands for; 1 where none was left out."""


def thinned(values: Array, most: int) -> Thinned:
    """A column as it is, or of every so many rows the lowest and the highest, the earlier first.

    Parameters
    ----------
    values : (n,) array
        A NaN is no value.
    most : int
        Numbers that are wanted, at least 2.
    """
    if len(values) <= most:
        return Thinned(values, 1.0)
    blocks, size = _blocks(values[:, None], most // 2)
    block = blocks[:, :, 0]
    none = np.isnan(block)
    low, high = np.argmin(np.where(none, np.inf, block), 1), np.argmax(np.where(none, -np.inf, block), 1)
    places = np.sort(np.stack([low, high], axis=1), axis=1)
    return Thinned(np.take_along_axis(block, places, axis=1).ravel(), size / 2)


def strongest(values: Array, most: int) -> Thinned:
    """Columns (n, k) as at most so many rows (m, k): of every so many rows the value farthest from zero."""
    if len(values) <= most:
        return Thinned(values, 1.0)
    blocks, size = _blocks(values, most)
    places = np.argmax(np.where(np.isnan(blocks), -1.0, np.abs(blocks)), axis=1)
    return Thinned(np.take_along_axis(blocks, places[:, None], axis=1)[:, 0], float(size))


def highest_by_octave(frequency: Array, values: Array, each: int) -> tuple[Array, Array]:
    """Lines of a spectrum, of which each so many-th part of an octave keeps its highest.

    Parameters
    ----------
    frequency : (n,) array
        Above zero, rising.
    values : (n,) array
    each : int
        Lines of an octave that are kept.
    """
    if not len(frequency):
        return frequency, values
    part = np.floor(each * np.log2(frequency / frequency[0])).astype(np.int64)
    starts = np.flatnonzero(np.diff(part, prepend=part[0] - 1))
    ends = np.append(starts[1:], len(values))
    rows = [first + int(np.argmax(values[first:last])) for first, last in zip(starts, ends, strict=True)]
    return frequency[rows], values[rows]


def _blocks(values: Array, most: int) -> tuple[Array, int]:
    """Rows (n, k) in blocks (b, size, k) of one size; the last is filled up with its own last row."""
    size = -(-len(values) // most)
    missing = -len(values) % size
    filled = np.concatenate([values, np.repeat(values[-1:], missing, axis=0)])
    return filled.reshape(-1, size, values.shape[1]), size
