"""Random rows: normal, independent, and each number a function of seed, tick and column alone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.disturbances import term_draws
from spheretwin.electronics.random_streams import noise_table, stream_key, width_of

SEED, TICKS, WIDTH, NAME = 7, 400, 11, "adc noise"


@pytest.fixture(scope="module")
def whole():
    return noise_table(SEED, 0, TICKS, ((NAME, WIDTH),))


@given(first=st.integers(0, TICKS - 1), ticks=st.integers(0, 40), width=st.integers(0, WIDTH))
def test_neither_blocks_nor_further_columns_move_a_bit(whole, first, ticks, width):
    ticks = min(ticks, TICKS - first)
    rows = noise_table(SEED, first, ticks, ((NAME, width),))
    assert rows.shape == (ticks, width)
    np.testing.assert_array_equal(rows, whole[first : first + ticks, :width])


def test_streams_are_those_of_the_seed_and_of_nothing_else(whole):
    assert not np.any(noise_table(SEED + 1, 0, TICKS, ((NAME, WIDTH),)) == whole)
    uniform = np.random.Generator(
        np.random.Philox(np.random.SeedSequence([SEED, stream_key(NAME), 0]))
    ).random(4 * TICKS)
    for place in range(5):
        assert not np.isin(term_draws(SEED, 0, TICKS, place), uniform).any()


def test_streams_of_other_names_move_no_bit(whole):
    streams = (("pot.alpha noise", 2), (NAME, WIDTH), ("coil.03 noise", 5))
    table = noise_table(SEED, 30, 50, streams)
    assert table.shape == (50, width_of(streams))
    np.testing.assert_array_equal(table[:, 2 : 2 + WIDTH], whole[30:80])
    assert not np.isin(np.delete(table, slice(2, 2 + WIDTH), axis=1), whole).any()
    assert noise_table(SEED, 0, 5, ()).shape == (5, 0)


@pytest.mark.parametrize("seed", [0, 7, 2**64 + 1, 10**40])
@pytest.mark.parametrize(("first", "ticks", "width"), [(0, 1000, 18), (10**12, 7, 3), (5, 1, 6)])
def test_bits_are_those_of_numpy(seed, first, ticks, width):
    expected = np.empty((ticks, 0))
    for block in range(-(-width // 4)):
        stream = np.random.Philox(np.random.SeedSequence([seed, stream_key(NAME), block])).advance(first)
        uniform = np.random.Generator(stream).random((ticks, 4))
        radius, angle = np.sqrt(-2 * np.log1p(-uniform[:, :2])), 2 * np.pi * uniform[:, 2:]
        expected = np.hstack([expected, radius * np.cos(angle), radius * np.sin(angle)])
    np.testing.assert_array_equal(noise_table(seed, first, ticks, ((NAME, width),)), expected[:, :width])
