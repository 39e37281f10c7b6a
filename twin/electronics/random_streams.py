"""Random streams of many parts, computed without a generator object for each.

A stream is keyed by the seed of the run and the name of the part. Neither another part nor its position in a
list changes a number. A part of the electronics draws its errors from ``np.random.default_rng([seed,
stream_key(name), channel])``. There are dozens of parts with few numbers each, and Python needs ten
microseconds to create a generator: a tenth of the time of a short run. Compiled code here computes the same
bits: NumPy's ``SeedSequence``, which hashes these numbers, and its ``PCG64``, a congruential generator of 128
bits of which each number is a hash of the state. NumPy guarantees both algorithms.
"""

from __future__ import annotations

from functools import cache
from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import allocation_free

# Of SeedSequence: multipliers and starts of its hashes, on words of 32 bits.
_WORD = np.uint64(0xFFFFFFFF)
_START_A, _FACTOR_A = np.uint64(0x43B0D7E5), np.uint64(0x931E8875)
_START_B, _FACTOR_B = np.uint64(0x8B51F9DD), np.uint64(0x58F38DED)
_MIX_LEFT, _MIX_RIGHT = np.uint64(0xCA01F9DD), np.uint64(0x4973F715)
_POOL = 4

# Of PCG64: the multiplier of its states, halves of 64 bits.
_FACTOR_HIGH, _FACTOR_LOW = np.uint64(2549297995355413924), np.uint64(4865540595714422341)

_HALF, _FULL = np.uint64(32), np.uint64(64)
_ONE, _FOLD, _TURN, _UNUSED = np.uint64(1), np.uint64(16), np.uint64(58), np.uint64(11)

# Distributions of quantities whose size is a field, as `explain` prints them.
UNIFORM: dict[str, Any] = {
    "distribution": "uniform between minus and plus the value, drawn from the seed for each part"
}
SMOOTH: dict[str, Any] = {
    "distribution": "sum of four harmonics with the value as largest magnitude, drawn from the seed for each"
    " part"
}
PHASE: dict[str, Any] = {"distribution": "amplitude of a sine whose phase is uniform, drawn from the seed"}
REVERSAL: dict[str, Any] = {
    "distribution": "normal, cut at 3 standard deviations, which are the value; new at each reversal"
}
NORMAL: dict[str, Any] = {"distribution": "normal with the value as standard deviation, new in each sample"}

NUMBER = 2.0**-53
"""Distance between two possible random numbers."""


@cache
def stream_key(name: str) -> int:
    """Return the number that the random streams of a part are keyed by: 64 bits of a digest of its name."""
    return int.from_bytes(blake2b(name.encode(), digest_size=8).digest(), "little")


def uniforms(seed: int, name: str, channels: int, count: int) -> NDArray[np.float64]:
    """Return the first numbers of the streams of some channels.

    Parameters
    ----------
    seed : int
        Seed of the run; from 0 on.
    name : str
        Name of the part.
    channels : int
    count : int
        Numbers of each channel.

    Returns
    -------
    (channels, count) array
        Row k is ``np.random.default_rng([seed, stream_key(name), k]).random(count)``: from 0 to below 1.
    """
    drawn = np.empty((channels, count))
    entropy = np.array([*_words(seed), *_words(stream_key(name)), 0], dtype=np.uint64)
    with np.errstate(over="ignore"):  # uncompiled: the overflow of products is intended
        _draw(entropy, np.empty(_POOL, dtype=np.uint64), np.empty(2 * _POOL, dtype=np.uint64), drawn)
    return drawn


def errors(seed: int, name: str, channels: int, count: int) -> NDArray[np.float64]:
    """Return shares of bounds, (channels, count), from -1 to 1, of the same streams as `uniforms`."""
    return 2 * uniforms(seed, name, channels, count) - 1


def _words(number: int) -> list[int]:
    """Return the words of 32 bits of a whole number, the lowest first; 0 has one word."""
    words = [number & 0xFFFFFFFF]
    while number := number >> 32:
        words.append(number & 0xFFFFFFFF)
    return words


@allocation_free
def _draw(
    entropy: NDArray[np.uint64], pool: NDArray[np.uint64], words: NDArray[np.uint64], drawn: NDArray
) -> None:
    """Fill `drawn` (channels, count); `entropy` ends with the channel number, other arrays are scratch."""
    for channel in range(drawn.shape[0]):
        entropy[entropy.shape[0] - 1] = channel
        _fill_pool(entropy, pool)
        _fill_words(pool, words)
        # Two words are a half of 64 bits, the lower one first; halves are the higher one first.
        start_high, start_low = words[0] | words[1] << _HALF, words[2] | words[3] << _HALF
        odd_high, odd_low = words[4] | words[5] << _HALF, words[6] | words[7] << _HALF
        odd_high, odd_low = odd_high << _ONE | odd_low >> (_FULL - _ONE), odd_low << _ONE | _ONE
        high, low = _sum(odd_high, odd_low, start_high, start_low)
        high, low = _next(high, low, odd_high, odd_low)
        for place in range(drawn.shape[1]):
            high, low = _next(high, low, odd_high, odd_low)
            folded, turn = high ^ low, high >> _TURN
            back = (_FULL - turn) & (_FULL - _ONE)
            drawn[channel, place] = np.float64((folded >> turn | folded << back) >> _UNUSED) * NUMBER


@allocation_free
def _fill_pool(entropy: NDArray[np.uint64], pool: NDArray[np.uint64]) -> None:
    factor = _START_A
    for i in range(_POOL):
        pool[i], factor = _hashed(entropy[i] if i < entropy.shape[0] else factor ^ factor, factor)
    for source in range(_POOL):
        for target in range(_POOL):
            if source != target:
                hashed, factor = _hashed(pool[source], factor)
                pool[target] = _mixed(pool[target], hashed)
    for source in range(_POOL, entropy.shape[0]):
        for target in range(_POOL):
            hashed, factor = _hashed(entropy[source], factor)
            pool[target] = _mixed(pool[target], hashed)


@allocation_free
def _hashed(word: np.uint64, factor: np.uint64) -> tuple[np.uint64, np.uint64]:
    """Return the hash of a word and the factor of the next one."""
    after = factor * _FACTOR_A & _WORD
    word = (word ^ factor) * after & _WORD
    return word ^ word >> _FOLD, after


@allocation_free
def _mixed(word: np.uint64, other: np.uint64) -> np.uint64:
    mixed = (_MIX_LEFT * word - _MIX_RIGHT * other) & _WORD
    return mixed ^ mixed >> _FOLD


@allocation_free
def _fill_words(pool: NDArray[np.uint64], words: NDArray[np.uint64]) -> None:
    factor = _START_B
    for i in range(words.shape[0]):
        word = pool[i % _POOL] ^ factor
        factor = factor * _FACTOR_B & _WORD
        word = word * factor & _WORD
        words[i] = word ^ word >> _FOLD


@allocation_free
def _next(high: np.uint64, low: np.uint64, odd_high: np.uint64, odd_low: np.uint64) -> tuple:
    """Return the next state, in halves of 64 bits: times the factor, plus the odd number of the stream."""
    # The high half of the product of the low ones, from products of their halves.
    a, b = low >> _HALF, low & _WORD
    c, d = _FACTOR_LOW >> _HALF, _FACTOR_LOW & _WORD
    middle = a * d + (b * d >> _HALF)
    carried = (middle & _WORD) + b * c
    over = a * c + (middle >> _HALF) + (carried >> _HALF)
    return _sum(over + high * _FACTOR_LOW + low * _FACTOR_HIGH, low * _FACTOR_LOW, odd_high, odd_low)


@allocation_free
def _sum(high: np.uint64, low: np.uint64, other_high: np.uint64, other_low: np.uint64) -> tuple:
    total = low + other_low
    return high + other_high + (_ONE if total < low else _ONE ^ _ONE), total


# The generator counts in blocks of four numbers; a tick takes one block.
NUMBERS_PER_COUNT = 4


Streams = tuple[tuple[str, int], ...]
"""Names of random streams and their widths in numbers per tick."""


def width_of(streams: Streams) -> int:
    """Return the total width of some streams in numbers per tick."""
    return sum(width for _, width in streams)


def noise_table(seed: int, first: int, ticks: int, streams: Streams) -> NDArray[np.float64]:
    """Return the numbers of some streams, (ticks, width), one stream next to the other."""
    rows = [noise_rows(seed, first, ticks, width, name) for name, width in streams]
    return np.ascontiguousarray(np.concatenate([np.empty((ticks, 0)), *rows], axis=1))


def noise_rows(seed: int, first: int, ticks: int, width: int, name: str) -> NDArray[np.float64]:
    """Return standard normal numbers at consecutive control ticks.

    Every four columns have a stream ``SeedSequence([seed, stream_key(name), block])``, counted by tick:
    each number depends only on seed, name, tick and column. Neither blocks of ticks nor further columns
    change a bit, and there is no state. The Box-Muller transform maps four uniform numbers to four normal
    ones. The usual ziggurat method consumes a varying count of numbers and cannot be indexed by tick.

    Parameters
    ----------
    seed : int
        Seed of the run.
    first : int
        First tick.
    ticks : int
        Number of ticks.
    width : int
        Numbers per tick.
    name : str
        Name of the stream.

    Returns
    -------
    (ticks, width) array
        At most 8.6 in magnitude: the uniform numbers are multiples of 2⁻⁵³.
    """
    rows, key = np.empty((ticks, width)), stream_key(name)
    for block, column in enumerate(range(0, width, NUMBERS_PER_COUNT)):
        counted = np.random.Philox(np.random.SeedSequence([seed, key, block])).advance(first)
        uniform = np.random.Generator(counted).random((ticks, NUMBERS_PER_COUNT))
        rows[:, column : column + NUMBERS_PER_COUNT] = _normal(uniform)[:, : width - column]
    return rows


def _normal(uniform: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return independent standard normal numbers (n, 4) from uniform numbers from 0 to below 1."""
    radius = np.sqrt(-2 * np.log1p(-uniform[:, :2]))
    angle = 2 * np.pi * uniform[:, 2:]
    return np.concatenate([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
