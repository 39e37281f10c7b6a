"""Decimation keeps lowest, highest and largest values, compared with loops over every block."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.viz.decimation import decimate_extremes, decimate_largest, octave_maxima

numbers = st.floats(-1e6, 1e6) | st.just(np.nan)


@given(st.lists(numbers, min_size=1, max_size=60), st.integers(2, 70))
def test_every_lowest_and_highest_is_kept_where_it_is(values, most):
    column = np.array(values)
    few = decimate_extremes(column, most)
    assert len(few.values) <= most
    if len(column) <= most:
        assert few.stride == 1
        assert few.values is column
        return
    size = int(2 * few.stride)
    assert size == -(-len(column) // (most // 2))
    for block, pair in enumerate(few.values.reshape(-1, 2)):
        rows = column[block * size : (block + 1) * size]
        finite = rows[~np.isnan(rows)]
        if len(finite):
            assert (min(pair), max(pair)) == (finite.min(), finite.max())
            first, last = (list(rows).index(each) for each in pair)
            assert first <= last or pair[0] == pair[1]


def test_the_strongest_of_each_column_keeps_its_sign():
    values = np.random.default_rng(0).normal(size=(103, 4))
    few = decimate_largest(values, 20)
    assert few.stride == 6  # 103 rows in at most 20
    for block, row in enumerate(few.values):
        rows = values[6 * block : 6 * block + 6]
        assert np.array_equal(row, rows[np.abs(rows).argmax(axis=0), range(4)])
    assert decimate_largest(values, 200).values is values


@pytest.mark.parametrize("each", [1, 7, 48])
def test_every_part_of_an_octave_keeps_its_highest_line(each):
    frequency = np.arange(1, 2000) * 0.1
    values = np.random.default_rng(1).uniform(size=len(frequency))
    few, kept = octave_maxima(frequency, values, each)
    assert np.all(np.diff(few) > 0)
    parts = np.floor(each * np.log2(frequency / frequency[0])).astype(int)
    expected = [values[parts == part].max() for part in np.unique(parts)]
    assert list(kept) == expected
    assert set(zip(few, kept, strict=True)) <= set(zip(frequency, values, strict=True))


def test_no_spectrum_is_none():
    nothing = np.empty(0)
    assert [len(each) for each in octave_maxima(nothing, nothing, 10)] == [0, 0]
