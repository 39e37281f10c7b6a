"""Vectors of four numbers, compiled and in plain Python, against NumPy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from spheretwin.models.base import vectors
from spheretwin.models.base.compiled import allocation_free, uncompiled

NUMBERS = st.floats(-1e6, 1e6)
FOURS = arrays(np.float64, vectors.WIDTH, elements=NUMBERS)
TABLE = np.random.default_rng(5).normal(size=(9, 4))

# Fused or rounded each: the two differ by less than four roundings of the largest term.
ROUNDING = 4 * np.finfo(float).eps


@allocation_free
def combine(a, b, number, result):
    x, y = vectors.load(a, 0), vectors.load(b, 0)
    vectors.store(number + x * y - number * (y - number), result, 0)


@allocation_free
def move(source, first, target, at):
    vectors.store(vectors.load(source, first), target, at)


@allocation_free
def fill_sides(x, result):
    vectors.store(vectors.side(vectors.load(x, 0)), result, 0)


@allocation_free
def limit(x, low, high, result):
    vectors.store(vectors.limited(vectors.load(x, 0), low, high), result, 0)


@allocation_free
def round_down(x, result):
    vectors.store(np.floor(vectors.load(x, 0)), result, 0)


@allocation_free
def check_range(x, low, high, result):
    result[0] = vectors.within(vectors.load(x, 0), low, high)


@allocation_free
def take_apart(x, result):
    made = vectors.vector(x[3], x[2], x[1], x[0])
    vectors.store(vectors.entry(made, 0), result, 2)
    vectors.store(vectors.total(made), result, 0)


@allocation_free
def look_up(place, result):
    vectors.store(vectors.cubic(TABLE, vectors.load(place, 0)), result, 0)


@allocation_free
def look_up_each(place, result):
    for i in range(place.shape[0]):
        result[i] = vectors.cubic(TABLE, place[i])


@allocation_free
def take_like(x, values, first, numbers, four):
    vectors.store(vectors.like(vectors.load(x, 0), values, first), four, 0)
    numbers[0] = vectors.like(x[0], values, first)


def made(function, *arguments, size=1.0):
    """Four numbers that a compiled function and its plain Python write into their last argument."""
    result, plain = np.full((2, vectors.WIDTH), np.nan)
    function(*arguments, result)
    uncompiled(function)(*arguments, plain)
    np.testing.assert_allclose(plain, result, rtol=0, atol=ROUNDING * size)
    return result


@given(FOURS, FOURS, NUMBERS)
def test_operators_are_those_of_numpy(a, b, number):
    largest = np.abs(a * b) + abs(number) * (np.abs(b) + abs(number)) + abs(number)
    result = made(combine, a, b, number, size=largest.max())
    difference = result - (number + a * b - number * (b - number))
    assert np.all(np.abs(difference) <= ROUNDING * largest)


@pytest.mark.parametrize("function", [move, uncompiled(move)])
def test_four_entries_are_read_and_written_and_no_others(function):
    source, target = np.arange(9.0), np.zeros(9)
    function(source, 3, target, 2)
    assert target.tolist() == [0, 0, 3, 4, 5, 6, 0, 0, 0]


@given(FOURS, st.tuples(NUMBERS, NUMBERS).map(sorted))
def test_limited_entries_are_those_of_numpy(x, ends):
    np.testing.assert_array_equal(made(limit, x, *ends), np.clip(x, *ends))


@given(FOURS, st.tuples(NUMBERS, NUMBERS).map(sorted))
def test_entries_are_within_a_range_if_all_of_them_are(x, ends):
    assert made(check_range, x, *ends)[0] == np.all((ends[0] <= x) & (x <= ends[1]))
    assert made(check_range, x, x.min(), x.max())[0] == 1
    for entry_outside in range(vectors.WIDTH):
        for value in (np.nan, np.inf, -np.inf, 2e6):
            changed = x.copy()
            changed[entry_outside] = value
            assert made(check_range, changed, -1e6, 1e6)[0] == 0


@given(FOURS)
def test_rounded_down_entries_are_those_of_numpy(x):
    np.testing.assert_array_equal(made(round_down, x), np.floor(x))


@given(FOURS)
def test_a_vector_is_taken_apart_into_numbers(x):
    result = made(take_apart, x)
    assert result[0] == x[3] + x[2] + (x[1] + x[0])
    assert result[2] == x[3]
    assert np.isnan(result[[1, 3]]).all()


def test_a_side_has_the_sign_of_its_entry():
    x = np.array([-3.0, 0.0, -0.0, 1e-300])
    np.testing.assert_array_equal(made(fill_sides, x), [-1, 1, -1, 1])


@given(arrays(np.float64, vectors.WIDTH, elements=st.floats(0, 9, exclude_max=True)))
def test_cubics_are_the_same_for_four_and_for_each(place):
    size = 4 * np.abs(TABLE).sum(1).max()
    four = made(look_up, place, size=size)
    np.testing.assert_array_equal(four, made(look_up_each, place, size=size))
    row = place.astype(int)
    expected = np.polynomial.polynomial.polyval(place - row, TABLE[row].T, tensor=False)
    np.testing.assert_allclose(four, expected, rtol=0, atol=ROUNDING * size)


@pytest.mark.parametrize("function", [take_like, uncompiled(take_like)])
def test_like_returns_a_number_for_a_number_and_four_for_a_vector(function):
    number, four = np.zeros(1), np.zeros(vectors.WIDTH)
    function(np.zeros(vectors.WIDTH), np.arange(9.0), 5, number, four)
    assert number[0] == 5
    assert four.tolist() == [5, 6, 7, 8]
