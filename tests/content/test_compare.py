"""Comparison of approved content: words are exact, numbers have a tolerance, every case has its file."""

import pytest

from tests.content.compare import MOST_LINES, difference
from tests.content.content import EXPECTED, all_cases


@pytest.mark.parametrize(
    ("expected", "actual"),
    [
        ("error 1.0 mrad", "error 1.0000009 mrad"),
        ("mean 0.0", "mean -3e-13"),
        ("from -2.5e-07 to 1", "from -2.5000001e-07 to 1"),
        ("n=3×3 at -0", "n=3×3 at 0"),
    ],
)
def test_rounding_is_no_difference(expected, actual):
    assert difference(expected, actual) == ""


@pytest.mark.parametrize(
    ("expected", "actual"),
    [
        ("error 1.0 mrad", "error 1.0 rad"), ("error 1.0 mrad", "error 1.000002 mrad"),
        ("rows 1000000", "rows 1000001"), ("mean 0.0", "mean 2e-12"), ("mean 1.0", "mean -1.0"),
        ("colour #12e567ff", "colour #12e568ff"), ("run_1", "run_2"), ("a\nb", "b\na"), ("a\nb", "a"),
        ("a", "a\na"), ("value 1.0", "value nan"),
    ],
)  # fmt: skip
def test_content_is_a_difference(expected, actual):
    assert difference(expected, actual)


def test_a_difference_has_the_first_differing_lines_only():
    expected = [f"line {place} 0.5" for place in range(200)]
    actual = [line.replace("0.5", "0.50000001") for line in expected]
    actual[7] = "other"
    lines = difference("\n".join(expected), "\n".join(actual)).splitlines()
    assert [line for line in lines if line[0] in "-+"][2:] == ["-line 7 0.5", "+other"]
    everything = difference("\n".join(expected), "\n".join(line.upper() for line in expected)).splitlines()
    assert len(everything) == MOST_LINES + 1


def test_every_case_has_an_approved_text_and_no_text_is_left_over():
    names = [name for cases in all_cases().values() for name in cases]
    assert len(set(names)) == len(names)
    assert {path.stem for path in EXPECTED.glob("*.txt")} == set(names)
