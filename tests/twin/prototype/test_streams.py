"""Numbers of many streams against NumPy's own generators, bit for bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.twin.electronics.streams import errors, uniforms

# One word of entropy for a seed, two, and more than the pool of four words holds.
SEEDS = [0, 1, 2**32 - 1, 2**32, 2**53 - 1, 2**64, 2**200 + 12345]


def theirs(seed, stage, channel):
    return np.random.default_rng([seed, stage, channel])


@pytest.mark.parametrize("seed", SEEDS)
def test_streams_are_those_of_numpy(seed):
    drawn, shares = uniforms(seed, 101, 18, 5), errors(seed, 101, 18, 5)
    for channel in range(18):
        np.testing.assert_array_equal(drawn[channel], theirs(seed, 101, channel).random(5))
        np.testing.assert_array_equal(shares[channel], theirs(seed, 101, channel).uniform(-1, 1, 5))


@given(st.integers(0, 2**96), st.integers(0, 2**32 - 1), st.integers(1, 4), st.integers(0, 40))
def test_so_are_those_of_any_seed_and_stage(seed, stage, channels, count):
    wanted = [theirs(seed, stage, channel).random(count) for channel in range(channels)]
    np.testing.assert_array_equal(uniforms(seed, stage, channels, count), wanted)


def test_neither_channels_nor_numbers_move_what_others_draw():
    np.testing.assert_array_equal(uniforms(7, 1, 18, 6)[:3, :2], uniforms(7, 1, 3, 2))
