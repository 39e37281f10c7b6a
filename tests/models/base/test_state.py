"""States of parts: saved, restored and transferred by one traversal, with every length checked."""

from typing import NamedTuple

import numpy as np
import pytest

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.record import capacity
from spheretwin.models.base.state import (
    arrays_of,
    push,
    restore_state,
    save_state,
    transfer_state,
)


class Filter(NamedTuple):
    gain: np.ndarray  # no state
    memory: np.ndarray
    count: np.ndarray
    begun: np.ndarray

    def state_arrays(self):
        return self.memory, self.count, self.begun


class Chain(NamedTuple):
    filters: tuple
    on: bool
    scratch: np.ndarray


def filled(rows, seed):
    generator = np.random.default_rng(seed)
    count, begun = generator.integers(-(2**50), 2**50, 2), generator.integers(0, 2, 1).astype(bool)
    return Filter(generator.random(4), generator.random((rows, 2)), count, begun)


def chain(rows, seed):
    return Chain((filled(rows, seed), filled(1, seed + 1)), True, np.zeros(3))


def test_a_state_is_restored_to_the_last_bit_whatever_its_kinds():
    one, other = chain(3, 0), chain(3, 10)
    gains = [each.gain.copy() for each in other.filters]
    restore_state(other, save_state(one), "the chain")
    for mine, theirs, gain in zip(one.filters, other.filters, gains, strict=True):
        for a, b in zip(mine.state_arrays(), theirs.state_arrays(), strict=True):
            assert a.tobytes() == b.tobytes()
        np.testing.assert_array_equal(theirs.gain, gain)
    assert len(arrays_of(one)) == 6
    assert save_state(True).shape == (0,)


@pytest.mark.parametrize(
    "change", [lambda s: s[:-1], lambda s: np.append(s, 0.0), lambda s: s[:0], lambda s: s[None]]
)
def test_another_length_is_refused_and_nothing_is_written(change):
    part = chain(2, 0)
    before = save_state(part)
    with pytest.raises(InputError, match="expected a snapshot with 12 numbers of the chain, received"):
        restore_state(part, change(np.zeros(12)), "the chain")
    assert save_state(part).tobytes() == before.tobytes()


class Switched(NamedTuple):
    on: bool
    inner: Filter


@pytest.mark.parametrize("before_on", [True, False])
@pytest.mark.parametrize("after_on", [True, False])
def test_only_a_part_that_is_on_before_and_after_keeps_its_state(before_on, after_on):
    before, after = Switched(before_on, filled(3, 0)), Switched(after_on, filled(3, 1))
    expected = before if before_on and after_on else Switched(after_on, filled(3, 1))
    transfer_state(before, after)
    assert save_state(after).tobytes() == save_state(expected).tobytes()
    transfer_state(before.inner, after)  # another class
    assert save_state(after).tobytes() == save_state(expected).tobytes()


@pytest.mark.parametrize("rows", [1, 2, 5])
def test_a_history_holds_the_last_values_newest_first(rows):
    history, values = np.zeros((rows, 2)), np.arange(1.0, 8.0)
    for value in values:
        push(history, 1, value)
    np.testing.assert_array_equal(history[:, 1], values[::-1][:rows])
    assert not history[:, 0].any()


@pytest.mark.parametrize(("rows", "expected"), [(2, [0, 1]), (3, [0, 1, 2]), (5, [0, 1, 2, 2, 2])])
def test_rows_that_are_missing_repeat_the_oldest(rows, expected):
    before, after = filled(3, 0), filled(rows, 1)
    transfer_state(before, after)
    np.testing.assert_array_equal(after.memory, before.memory[expected])
    np.testing.assert_array_equal(after.count, before.count)


def test_the_capacity_of_a_history_is_a_power_of_two_of_at_least_eight():
    assert [capacity(entries) for entries in (1, 2, 8, 9, 16, 17, 1002)] == [8, 8, 8, 16, 16, 32, 1024]
