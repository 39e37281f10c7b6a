"""Records: layout, columns and transfer of arrays of records, and the same data in compiled code."""

import numpy as np
import pytest
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.base.record import (
    Record,
    capacity,
    columns_of,
    field,
    set_states,
    states_of,
    transfer_rows,
)


class Filter(Record):
    on: bool = field("whether it acts")
    gain: float = field("gain", "A/V")
    memory: Array = field("past values", "A", ("taps", "groups"), state=True)
    contact: NDArray[np.int64] = field("connection", "", "groups", fault=True)


class Bank(Record):
    first: Filter = field("one channel", groups=1)
    pair: Filter = field("two filters of all groups", shape=2)
    count: int = field("ticks", state=True)


def bank(seed, rows=3):
    made = Bank.zeros(rows, taps=2, groups=4)
    made["first"]["memory"] = np.random.default_rng(seed).random((rows, 2, 1))
    made["pair"]["memory"] = np.random.default_rng(seed + 1).random((rows, 2, 2, 4))
    made["count"], made["first"]["on"] = seed, 1
    return made


def test_layout_is_that_of_the_declarations_and_every_field_is_aligned():
    rows = bank(0)
    assert rows["first"]["memory"].shape == (3, 2, 1)
    assert rows["pair"]["contact"].shape == (3, 2, 4)
    assert rows.dtype is Bank.dtype(groups=4, taps=2)
    assert all(offset % 8 == 0 for _, offset, *_ in rows.dtype.fields.values())
    assert Bank.fields()["count"].is_state
    with pytest.raises(TypeError, match="Filter: expected the size taps of memory, received"):
        Bank.zeros(groups=4)


def test_a_name_of_numpy_s_records_is_refused():
    class Flow(Record):
        mean: float = field("mean current", "A")

    with pytest.raises(TypeError, match=r"Flow: expected a name that .* does not have, received mean"):
        Flow.zeros()


def test_two_declarations_of_one_layout_with_other_states_are_refused():
    class Volume(Record):
        level: float = field("level", "m", state=True)

    class Tank(Record):
        level: float = field("level", "m")

    Volume.zeros()
    with pytest.raises(TypeError, match="Tank: expected the same states as in Volume"):
        Tank.zeros()


@allocation_free
def advance(bank, value):
    filters = bank.pair
    for place in range(2):
        if filters[place].on:
            filters[place].memory[0, 1] = filters[place].gain * value
    bank.count += 1


def test_compiled_code_and_columns_have_the_same_numbers():
    rows = bank(0)
    rows["pair"]["on"][:, 1], rows["pair"]["gain"][:, 1] = 1, [2.0, 3.0, 4.0]
    before = rows.copy()
    for place in range(3):
        advance(rows[place], 10.0)
    np.testing.assert_array_equal(rows["pair"]["memory"][:, 1, 0, 1], [20.0, 30.0, 40.0])
    np.testing.assert_array_equal(rows["count"], 1)
    rows["count"], rows["pair"]["memory"] = before["count"], before["pair"]["memory"]
    assert rows.tobytes() == before.tobytes()


def test_columns_of_the_state_are_views():
    rows = bank(0)
    columns = list(columns_of(rows, lambda declared: declared.is_state))
    assert [column.shape for column in columns] == [(3, 2, 1), (3, 2, 2, 4), (3,)]
    for column in columns:
        column[...] = 7
    assert rows["pair"]["memory"].min() == rows["count"].min() == 7
    assert len(list(columns_of(rows, lambda declared: declared.set_by_faults))) == 2


def test_the_state_is_restored_to_the_last_bit_and_parameters_stay():
    before, after = bank(1), bank(5)
    before["count"], after["first"]["gain"] = -(2**50) + 1, 2.5
    set_states(after, states_of(before))
    assert states_of(after).tobytes() == states_of(before).tobytes()
    assert states_of(after).shape == (3, 2 + 16 + 1)
    np.testing.assert_array_equal(after["first"]["gain"], 2.5)
    assert (after["count"] == -(2**50) + 1).all()


def test_transfer_keeps_parameters_and_the_state_of_parts_that_are_off():
    before, after = bank(1), bank(5)
    before["first"]["on"], after["first"]["gain"] = [1, 0, 1], 2.5
    expected = after["first"]["memory"].copy()
    expected[[0, 2]] = before["first"]["memory"][[0, 2]]
    transfer_rows(before, after)
    np.testing.assert_array_equal(after["first"]["memory"], expected)
    np.testing.assert_array_equal(after["first"]["gain"], 2.5)
    np.testing.assert_array_equal(after["count"], 1)


@pytest.mark.parametrize("taps", [2, 3, 5])
def test_a_history_of_another_length_repeats_the_oldest_entry(taps):
    before, after = bank(1), Bank.zeros(3, taps=taps, groups=4)
    before["pair"]["on"] = after["pair"]["on"] = [[1, 1], [0, 1], [1, 0]]
    transfer_rows(before, after)
    oldest = before["pair"]["memory"][0, 1, 1]
    np.testing.assert_array_equal(
        after["pair"]["memory"][0, 1], [before["pair"]["memory"][0, 1, 0], *[oldest] * (taps - 1)]
    )
    assert not after["pair"]["memory"][1, 0].any()
    np.testing.assert_array_equal(
        after["pair"]["memory"][1, 1, 1:], [before["pair"]["memory"][1, 1, 1]] * (taps - 1)
    )


def test_the_capacity_of_a_history_is_a_power_of_two_of_at_least_32():
    assert [capacity(entries) for entries in (1, 8, 32, 33, 64, 65, 1002)] == [32, 32, 32, 64, 64, 128, 1024]
