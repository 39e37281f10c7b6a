"""How messages word what they were given."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.models.base.errors import (
    LONGEST_LINE,
    LONGEST_VALUE,
    LONGEST_WORD,
    InputError,
    SpheretwinError,
    did_you_mean,
    distinct_texts,
    is_plain,
    one_line,
    shown,
)


@given(st.text(st.characters(), max_size=50) | st.integers(0, 20_000).map(lambda n: "\x1b[31m 7" * n))
def test_any_text_becomes_one_short_printable_line(text):
    line = one_line(text)
    assert line.isprintable()
    assert len(line) <= LONGEST_LINE
    assert one_line(line) == line


def test_what_can_be_shown_is_left_alone():
    text = "scenario Nutation für α: expected 'a\\b', received 0.1 …  two spaces"
    assert one_line(text) == text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("a\nb\tc", r"a\nb\tc"),
        ("\x1b[31m", r"\x1b[31m"),
        ("a\u2028b\x85", r"a\u2028b\x85"),
        ("\udcff", r"\udcff"),
    ],
)
def test_what_cannot_be_shown_is_escaped(text, shown):
    assert one_line(text) == shown


def test_a_long_value_keeps_both_its_ends_and_its_sentence():
    line = one_line(f"seed: expected a whole number, received 12{'9' * 5000}34, which is none")
    assert line.startswith("seed: expected a whole number, received 129")
    assert line.endswith("934, which is none")
    assert "…" in line
    assert len(line) < LONGEST_WORD + 100
    assert one_line("9" * LONGEST_WORD) == "9" * LONGEST_WORD


def test_a_received_value_is_shown_on_one_line():
    assert shown("a\n  b") == r"'a\n  b'"
    assert shown(np.eye(2)) == "[[1.0, 0.0], [0.0, 1.0]]"
    assert len(shown(list(range(1000)))) == LONGEST_VALUE
    assert shown(10**5000) == "a number of too many digits"


@pytest.mark.parametrize("each", ["\n", "\t", "\0", "\x1b", "\x7f", "\x9b", "\udcff"])
def test_control_characters_are_not_plain(each):
    assert not is_plain(f"a{each}b")
    assert is_plain("Nutation für α · 猫 🐈\u200d⬛")


def test_every_error_of_the_package_is_one_line_in_python_too():
    error = InputError("expected\nless,\x1b[2J received more")
    assert str(error) == r"expected\nless,\x1b[2J received more"
    assert str(pickle.loads(pickle.dumps(error))) == str(error)
    assert isinstance(error, SpheretwinError)


@pytest.mark.parametrize(
    ("numbers", "texts"),
    [
        ((0.045, 0.0455), ["0.045", "0.0455"]),
        ((0.045, 0.0450000001), ["0.045", "0.0450000001"]),
        ((20.0, 20.0), ["20", "20"]),
        ((1.0, -1.0, 1 + 2**-52), ["1", "-1", "1.0000000000000002"]),
        ((1 / 3,), ["0.333333"]),
        ((0.0, np.nan, np.inf), ["0", "nan", "inf"]),
    ],
)
def test_different_numbers_have_different_texts_of_few_digits(numbers, texts):
    assert distinct_texts(*numbers) == texts


@given(st.lists(st.floats(allow_nan=False), max_size=5))
def test_texts_differ_as_the_numbers_do(numbers):
    # Zeros of both signs are one number in two texts.
    numbers = [number + 0.0 for number in numbers]
    assert len(set(distinct_texts(*numbers))) == len(set(numbers))


def test_a_near_name_is_suggested_and_a_far_one_is_not():
    assert did_you_mean("controler", ["plant", "controller"]) == "; did you mean controller?"
    assert did_you_mean("xyz", ["plant", "controller"]) == ""
    assert did_you_mean("", ["plant"]) == ""
    assert did_you_mean("controler" * 10_000, ["plant", "controller"]) == ""
