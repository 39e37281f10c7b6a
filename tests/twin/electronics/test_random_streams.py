"""Numbers of many streams against NumPy's own generators, bit for bit."""

from hashlib import blake2b

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.electronics import random_streams
from spheretwin.electronics.drive_section import STAGES as DRIVE_STAGES
from spheretwin.electronics.random_streams import errors, stream_key, uniforms
from spheretwin.electronics.sensor_chain import STAGES as SENSOR_STAGES
from spheretwin.faults.schedule import part_names

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


def test_a_key_with_one_word_is_hashed_as_numpy_does(monkeypatch):
    """One key in 2³² has no second word, which then is not hashed."""
    monkeypatch.setattr(random_streams, "stream_key", lambda name: 101)
    np.testing.assert_array_equal(uniforms(7, "any", 1, 5)[0], np.random.default_rng([7, 101, 0]).random(5))


def test_names_of_parts_are_streams_of_their_own():
    stages = [f"sensors.{name}" for name in SENSOR_STAGES] + [f"drive.{name}" for name in DRIVE_STAGES]
    parts = [*part_names(18), *stages, "sensors.current"]
    names = [f"{part}{kind}" for part in parts for kind in ("", " noise", " intermittent")]
    assert len({stream_key(name) for name in names}) == len(names)


def test_neither_channels_nor_numbers_move_what_others_draw():
    np.testing.assert_array_equal(uniforms(7, "adc", 18, 6)[:3, :2], uniforms(7, "adc", 3, 2))
