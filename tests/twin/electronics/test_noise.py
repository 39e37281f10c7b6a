"""Random numbers against NumPy's generators, bit for bit: a function of seed, name, tick and column alone."""

from hashlib import blake2b

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.electronics import random_streams
from spheretwin.electronics.drive_section import STAGES as DRIVE_STAGES
from spheretwin.electronics.random_streams import errors, noise_table, stream_key, uniforms, width_of
from spheretwin.electronics.sensor_chain import STAGES as SENSOR_STAGES
from spheretwin.faults.schedule import part_names
from spheretwin.trajectories.disturbances import term_draws

SEED, TICKS, WIDTH, STREAM = 7, 400, 11, "adc noise"


@pytest.fixture(scope="module")
def whole():
    return noise_table(SEED, 0, TICKS, ((STREAM, WIDTH),))


@given(first=st.integers(0, TICKS - 1), ticks=st.integers(0, 40), width=st.integers(0, WIDTH))
def test_neither_blocks_nor_further_columns_move_a_bit(whole, first, ticks, width):
    ticks = min(ticks, TICKS - first)
    rows = noise_table(SEED, first, ticks, ((STREAM, width),))
    assert rows.shape == (ticks, width)
    np.testing.assert_array_equal(rows, whole[first : first + ticks, :width])


def test_streams_are_those_of_the_seed_and_of_nothing_else(whole):
    assert not np.any(noise_table(SEED + 1, 0, TICKS, ((STREAM, WIDTH),)) == whole)
    uniform = np.random.Generator(
        np.random.Philox(np.random.SeedSequence([SEED, stream_key(STREAM), 0]))
    ).random(4 * TICKS)
    for place in range(5):
        assert not np.isin(term_draws(SEED, 0, TICKS, place), uniform).any()


def test_streams_of_other_names_move_no_bit(whole):
    streams = (("pot.alpha noise", 2), (STREAM, WIDTH), ("coil.03 noise", 5))
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
        stream = np.random.Philox(np.random.SeedSequence([seed, stream_key(STREAM), block])).advance(first)
        uniform = np.random.Generator(stream).random((ticks, 4))
        radius, angle = np.sqrt(-2 * np.log1p(-uniform[:, :2])), 2 * np.pi * uniform[:, 2:]
        expected = np.hstack([expected, radius * np.cos(angle), radius * np.sin(angle)])
    np.testing.assert_array_equal(noise_table(seed, first, ticks, ((STREAM, width),)), expected[:, :width])


# One word of entropy for a seed, two, and more than the pool of four words holds.
SEEDS = [0, 1, 2**32 - 1, 2**32, 2**53 - 1, 2**64, 2**200 + 12345]


def theirs(seed, name, channel):
    key = int.from_bytes(blake2b(name.encode(), digest_size=8).digest(), "little")
    return np.random.default_rng([seed, key, channel])


@given(st.integers(0, 2**96) | st.sampled_from(SEEDS), st.text(), st.integers(1, 4), st.integers(0, 40))
def test_streams_are_those_of_numpy(seed, name, channels, count):
    streams = [theirs(seed, name, channel) for channel in range(channels)]
    np.testing.assert_array_equal(uniforms(seed, name, channels, count), [s.random(count) for s in streams])
    streams = [theirs(seed, name, channel).uniform(-1, 1, count) for channel in range(channels)]
    np.testing.assert_array_equal(errors(seed, name, channels, count), streams)


@given(
    st.lists(st.sampled_from(SEEDS) | st.integers(0, 2**63 - 1), min_size=1, max_size=5), st.integers(0, 300)
)
def test_rows_are_those_of_their_seeds(seeds, ticks):
    streams = (("pot.alpha noise", 2), (STREAM, WIDTH), ("much", 70))
    column = np.array([[seed] for seed in seeds], dtype=None if max(seeds) < 2**63 else object)
    for function in (uniforms, errors):
        rows = function(column, STREAM, 3, 5)
        assert rows.tobytes() == b"".join(function(seed, STREAM, 3, 5).tobytes() for seed in seeds)
    rows = noise_table(column, 7, ticks, streams)
    assert rows.tobytes() == b"".join(noise_table(seed, 7, ticks, streams).tobytes() for seed in seeds)


def test_a_key_with_one_word_is_hashed_as_numpy_does(monkeypatch):
    """One key in 2³² has no second word, which then is not hashed."""
    monkeypatch.setattr(random_streams, "stream_key", lambda name: 101)
    np.testing.assert_array_equal(uniforms(7, "any", 1, 5)[0], np.random.default_rng([7, 101, 0]).random(5))


def test_names_of_parts_are_streams_of_their_own():
    stages = [f"sensors.{name}" for name in SENSOR_STAGES] + [f"drive.{name}" for name in DRIVE_STAGES]
    parts = [*part_names(18), *stages, "sensors.current"]
    names = [f"{part}{kind}" for part in parts for kind in ("", " noise", " intermittent")]
    assert len({stream_key(name) for name in names}) == len(names)
