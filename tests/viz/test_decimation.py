"""Decimation keeps bounds, means and highest lines, compared with loops over every bin."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.viz.decimation import envelope, mean_and_deviation, octave_maxima

numbers = st.floats(-1e6, 1e6) | st.just(np.nan)


@given(st.lists(numbers, min_size=1, max_size=60), st.integers(1, 70))
def test_an_envelope_has_the_bounds_and_the_mean_of_every_bin(values, most):
    bins = envelope(np.array(values), most)
    size = -(-len(values) // most)
    assert list(bins.starts) == list(range(0, len(values), size))
    assert len(bins.starts) <= most
    for place, start in enumerate(bins.starts):
        present = [value for value in values[start : start + size] if not np.isnan(value)]
        drawn = (bins.low[place], bins.high[place], bins.mean[place])
        if present:
            assert drawn[:2] == (min(present), max(present))
            # A sum of 60 numbers below 1e6.
            assert drawn[2] == pytest.approx(sum(present) / len(present), abs=1e-8)
        else:
            assert np.isnan(drawn).all()


def test_cells_have_mean_and_standard_deviation_of_each_column():
    values = np.random.default_rng(0).normal(size=(103, 4))
    cells = mean_and_deviation(values, 20)
    assert list(cells.starts) == list(range(0, 103, 6))  # 103 rows in at most 20
    for place, start in enumerate(cells.starts):
        rows = values[start : start + 6]
        np.testing.assert_allclose(cells.mean[place], rows.mean(axis=0), atol=1e-15)
        np.testing.assert_allclose(cells.deviation[place], rows.std(axis=0), atol=1e-15)
    every = mean_and_deviation(values, 200)
    assert np.array_equal(every.mean, values)
    assert not every.deviation.any()


@pytest.mark.parametrize("each", [1, 7, 48])
def test_every_part_of_an_octave_keeps_its_highest_line(each):
    frequency = np.arange(1, 2000) * 0.1
    values = np.random.default_rng(1).uniform(size=len(frequency))
    few, highest = octave_maxima(frequency, values, each)
    assert np.all(np.diff(few) > 0)
    parts = np.floor(each * np.log2(frequency / frequency[0])).astype(int)
    expected = [values[parts == part].max() for part in np.unique(parts)]
    assert list(highest) == expected
    assert set(zip(few, highest, strict=True)) <= set(zip(frequency, values, strict=True))


def test_no_spectrum_is_none():
    nothing = np.empty(0)
    assert [len(each) for each in octave_maxima(nothing, nothing, 10)] == [0, 0]
