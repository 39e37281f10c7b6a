"""Random streams of many parts, computed without a generator object for each.

A stream is keyed by the seed of the run and the name of the part. Neither another part nor its position in a
list changes a number. A part of the electronics draws its errors from ``np.random.default_rng([seed,
stream_key(name), channel])``. There are dozens of parts with few numbers each, and Python needs ten
microseconds to create a generator: a tenth of the time of a short run. Compiled code here computes the same
bits: NumPy's ``SeedSequence``, which hashes these numbers, and its ``PCG64``, a congruential generator of 128
bits of which each number is a hash of the state. NumPy guarantees both algorithms.
"""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from functools import cache, lru_cache
from hashlib import blake2b
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import COMPILES, allocation_free, high_product, inlined, rounding_each

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


Seed = int | NDArray[Any]
"""Seed of a run, from 0 on; or whole numbers (n, 1), the seeds of n rows."""


def uniforms(seed: Seed, name: str, channels: int, count: int) -> NDArray[np.float64]:
    """Return the first numbers of the streams of some channels.

    Parameters
    ----------
    seed : int or (n, 1) array of int
        Seed of the run, from 0 on, or that of each row.
    name : str
        Name of the part.
    channels : int
    count : int
        Numbers of each channel.

    Returns
    -------
    (channels, count) array, or (n, channels, count) array for n rows
        Channel k is ``np.random.default_rng([seed, stream_key(name), k]).random(count)``: from 0 to below 1.
    """
    seeds, key = _words(seed), _words(stream_key(name))[0]
    drawn = np.empty((len(seeds), channels, count))
    with _overflowing():
        _draw(seeds, key, _scratch(seeds, key), drawn)
    return drawn if isinstance(seed, np.ndarray) else drawn[0]


def _overflowing() -> AbstractContextManager[None]:
    """Return a context in which products may overflow, as intended; compiled code does not report it."""
    return nullcontext() if COMPILES else np.errstate(over="ignore")


def errors(seed: Seed, name: str, channels: int, count: int) -> NDArray[np.float64]:
    """Return shares of bounds, from -1 to 1, of the same streams and of the same shape as `uniforms`."""
    return 2 * uniforms(seed, name, channels, count) - 1


@lru_cache(maxsize=256)
def _words_of(number: int) -> NDArray[np.uint64]:
    return _words(np.array([[number]]))  # of Python's numbers if 64 bits do not suffice


def _words(numbers: Seed) -> NDArray[np.uint64]:
    """Return the words of 32 bits of whole numbers, (n, words), the lowest first."""
    if not isinstance(numbers, np.ndarray):
        return _words_of(numbers)
    rest, words = numbers, [numbers & 0xFFFFFFFF]
    while (rest := rest >> 32).any():
        words.append(rest & 0xFFFFFFFF)
    return np.concatenate(words, axis=1, dtype=np.uint64, casting="unsafe")


def _scratch(seeds: NDArray[np.uint64], key: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return scratch for the hashes: rows for entropy, pool and words."""
    return np.empty((3, 2 * _POOL + seeds.shape[1] + len(key) + 1), dtype=np.uint64)


@allocation_free
def _draw(
    seeds: NDArray[np.uint64], key: NDArray[np.uint64], scratch: NDArray[np.uint64], drawn: NDArray
) -> None:
    """Fill `drawn` (n, channels, count) from the words of the seeds (n, words) and of the key."""
    words = scratch[2]
    for row in range(drawn.shape[0]):
        for channel in range(drawn.shape[1]):
            _hash(seeds[row], key, channel, scratch)
            _draw_channel(words, drawn[row, channel])


@allocation_free
def _draw_channel(words: NDArray[np.uint64], drawn: NDArray) -> None:
    """Fill `drawn` (count,)."""
    # Two words are a half of 64 bits, the lower one first; halves are the higher one first.
    start_high, start_low = words[0] | words[1] << _HALF, words[2] | words[3] << _HALF
    odd_high, odd_low = words[4] | words[5] << _HALF, words[6] | words[7] << _HALF
    odd_high, odd_low = odd_high << _ONE | odd_low >> (_FULL - _ONE), odd_low << _ONE | _ONE
    high, low = _sum(odd_high, odd_low, start_high, start_low)
    high, low = _next(high, low, odd_high, odd_low)
    for place in range(drawn.shape[0]):
        high, low = _next(high, low, odd_high, odd_low)
        folded, turn = high ^ low, high >> _TURN
        back = (_FULL - turn) & (_FULL - _ONE)
        drawn[place] = np.float64((folded >> turn | folded << back) >> _UNUSED) * NUMBER


@allocation_free
def _hash(seed: NDArray[np.uint64], key: NDArray[np.uint64], last: int, scratch: NDArray[np.uint64]) -> None:
    """Write into the last row of scratch the hash of the words of seed and key, and of a last number.

    A seed may have zeros after its last word, as other seeds are longer.
    """
    entropy, length = scratch[0], seed.shape[0]
    while length > 1 and seed[length - 1] == 0:
        length -= 1
    for i in range(length):
        entropy[i] = seed[i]
    for i in range(key.shape[0]):
        entropy[length + i] = key[i]
    length += key.shape[0]
    entropy[length] = last
    _fill_pool(entropy[: length + 1], scratch[1])
    _fill_words(scratch[1], scratch[2])


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
    for i in range(2 * _POOL):
        word = pool[i % _POOL] ^ factor
        factor = factor * _FACTOR_B & _WORD
        word = word * factor & _WORD
        words[i] = word ^ word >> _FOLD


@allocation_free
def _next(high: np.uint64, low: np.uint64, odd_high: np.uint64, odd_low: np.uint64) -> tuple:
    """Return the next state, in halves of 64 bits: times the factor, plus the odd number of the stream."""
    over = high_product(low, _FACTOR_LOW)
    return _sum(over + high * _FACTOR_LOW + low * _FACTOR_HIGH, low * _FACTOR_LOW, odd_high, odd_low)


@allocation_free
def _sum(high: np.uint64, low: np.uint64, other_high: np.uint64, other_low: np.uint64) -> tuple:
    total = low + other_low
    return high + other_high + (_ONE if total < low else _ONE ^ _ONE), total


# The generator counts in blocks of four numbers; a tick takes one block.
NUMBERS_PER_COUNT = 4

# Of Philox: factors of the rounds, and steps of the keys.
_PHILOX_A, _PHILOX_C = np.uint64(0xD2E7470EE14C6C93), np.uint64(0xCA5A826395121157)
_STEP_0, _STEP_1 = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBB67AE8584CAA73B)
_ROUNDS, _ZERO = 10, np.uint64(0)


Streams = tuple[tuple[str, int], ...]
"""Names of random streams and their widths in numbers per tick."""


def width_of(streams: Streams) -> int:
    """Return the total width of some streams in numbers per tick."""
    return sum(width for _, width in streams)


# Numbers that are transformed at a time, so that they stay in the cache of a processor.
_CACHED = 2**14


def noise_table(seed: Seed, first: int, ticks: int, streams: Streams) -> NDArray[np.float64]:
    """Return standard normal numbers at consecutive control ticks, one stream next to the other.

    Every four columns of a stream are a ``np.random.Philox(SeedSequence([seed, stream_key(name), block]))``,
    counted by tick: each number depends only on seed, name, tick and column. Neither blocks of ticks nor
    further columns change a bit, and there is no state. The Box-Muller transform maps four uniform numbers
    to four normal ones. The usual ziggurat method consumes a varying count of numbers and cannot be indexed
    by tick.

    Parameters
    ----------
    seed : int or (n, 1) array of int
        Seed of the run, or that of each row.
    first : int
        First tick.
    ticks : int
        Number of ticks.
    streams : tuple of (str, int)
        Names and widths, numbers per tick.

    Returns
    -------
    (ticks, total width) array, or (n, ticks, total width) array for n rows
        At most 8.6 in magnitude: the uniform numbers are multiples of 2⁻⁵³.
    """
    seeds, column = _words(seed), 0
    table = np.empty((len(seeds), ticks, width_of(streams)))
    for name, width in streams:
        key, some = _words(stream_key(name))[0], 1 + _CACHED // (1 + ticks * width)
        for row in range(0, len(seeds), some):
            part = table[row : row + some, :, column : column + width]
            _fill_normal(seeds[row : row + some], key, first, part)
        column += width
    return table if isinstance(seed, np.ndarray) else table[0]


def _fill_normal(
    seeds: NDArray[np.uint64], key: NDArray[np.uint64], first: int, table: NDArray[np.float64]
) -> None:
    """Fill the table (n, ticks, width) of one stream.

    The functions are those of NumPy: compiled ones of another library round differently.
    """
    rows, ticks, width = table.shape
    pairs, with_sine = 2 * -(-width // NUMBERS_PER_COUNT), 2 * ((width + 1) // NUMBERS_PER_COUNT)
    uniform, angle = np.empty((2, pairs, rows, ticks))
    with _overflowing():
        _fill_pairs(seeds, key, _scratch(seeds, key), np.uint64(first), uniform, angle)
    logarithm, sine = np.log1p(uniform, out=uniform), np.sin(angle[:with_sine])
    _transform(logarithm, np.cos(angle, out=angle), sine, table)


@rounding_each
def _fill_pairs(
    seeds: NDArray[np.uint64],
    key: NDArray[np.uint64],
    scratch: NDArray[np.uint64],
    first: np.uint64,
    uniform: NDArray[np.float64],
    angle: NDArray[np.float64],
) -> None:
    """Fill ``-u`` and ``2 pi v`` (pairs, n, ticks) with the uniform numbers of two pairs of each block."""
    words, (pairs, rows, ticks) = scratch[2], uniform.shape
    for row in range(rows):
        for block in range(pairs // 2):
            _hash(seeds[row], key, block, scratch)
            key_0, key_1 = words[0] | words[1] << _HALF, words[2] | words[3] << _HALF
            for tick in range(ticks):
                a, b, c, d = _philox(first + np.uint64(tick) + _ONE, key_0, key_1)
                uniform[2 * block, row, tick] = -(np.float64(a >> _UNUSED) * NUMBER)
                uniform[2 * block + 1, row, tick] = -(np.float64(b >> _UNUSED) * NUMBER)
                angle[2 * block, row, tick] = 2 * np.pi * (np.float64(c >> _UNUSED) * NUMBER)
                angle[2 * block + 1, row, tick] = 2 * np.pi * (np.float64(d >> _UNUSED) * NUMBER)


@rounding_each
def _transform(
    logarithm: NDArray[np.float64], cosine: NDArray[np.float64], sine: NDArray[np.float64], table: NDArray
) -> None:
    """Fill the table with the normal numbers of all pairs: cosines of a block first, then its sines."""
    rows, ticks, width = table.shape
    for row in range(rows):
        for tick in range(ticks):
            for column in range(width):
                block, place = column // NUMBERS_PER_COUNT, column % NUMBERS_PER_COUNT
                pair = 2 * block + place % 2
                turn = cosine[pair, row, tick] if place < 2 else sine[pair, row, tick]
                table[row, tick, column] = sqrt(-2.0 * logarithm[pair, row, tick]) * turn


@inlined
def _philox(count: np.uint64, key_0: np.uint64, key_1: np.uint64) -> tuple:
    """Return the four numbers of a count below 2⁶⁴: Philox 4x64 of ten rounds."""
    a, b, c, d = count, _ZERO, _ZERO, _ZERO
    for _ in range(_ROUNDS):
        high_a, low_a = high_product(_PHILOX_A, a), _PHILOX_A * a
        high_c, low_c = high_product(_PHILOX_C, c), _PHILOX_C * c
        a, b, c, d = high_c ^ b ^ key_0, low_c, high_a ^ d ^ key_1, low_a
        key_0, key_1 = key_0 + _STEP_0, key_1 + _STEP_1
    return a, b, c, d
