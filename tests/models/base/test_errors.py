"""How messages word what they were given."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.models.base import errors


@given(st.text(st.characters(), max_size=50) | st.integers(0, 20_000).map(lambda n: "\x1b[31m 7" * n))
def test_any_text_becomes_one_short_printable_line(text):
    line = errors.one_line(text)
    assert line.isprintable()
    assert len(line) <= errors.LONGEST_LINE
    assert errors.one_line(line) == line


@pytest.mark.parametrize("each", ["\n", "\t", "\0", "\x1b", "\x7f", "\x9b", "\udcff"])
def test_control_characters_are_not_plain(each):
    assert not errors.is_plain(f"a{each}b")
    assert errors.is_plain("Nutation für α · 猫 🐈\u200d⬛")


def test_every_error_of_the_package_is_one_line_in_python_too():
    error = errors.InputError("expected\nless,\x1b[2J received more")
    assert str(error) == r"expected\nless,\x1b[2J received more"
    assert str(pickle.loads(pickle.dumps(error))) == str(error)
    assert isinstance(error, errors.SpheretwinError)


def test_zero_and_numbers_that_are_not_finite_have_texts():
    assert errors.distinct_texts(0.0, np.nan, np.inf, -1.0) == ["0", "nan", "inf", "-1"]


@given(st.lists(st.floats(allow_nan=False), max_size=5))
def test_texts_differ_as_the_numbers_do(numbers):
    # Zeros of both signs are one number in two texts.
    numbers = [number + 0.0 for number in numbers]
    assert len(set(errors.distinct_texts(*numbers))) == len(set(numbers))
