"""Colours of runs: by law if these are distinct, and visible on a dark ground."""

import math

import pytest

from spheretwin.viz import theme
from spheretwin.viz.comparison.runs import on_dark, run_colours


def test_a_law_has_its_colour_and_another_run_of_it_another():
    colours = run_colours(["afsm", "pd", "afsm", "mine.py:Mine"])
    assert colours[:2] == [theme.LAW_COLOURS["afsm"], theme.LAW_COLOURS["pd"]]
    assert colours[2] in theme.SPARE
    assert colours[3] == theme.OTHER_LAW


@pytest.mark.parametrize("law", ["afsm", "afsm_eso"])
@pytest.mark.parametrize("count", [2, 5, 6, 7, 30])
def test_no_two_runs_of_one_law_have_one_colour_on_any_ground(law, count):
    colours = run_colours([law] * count)
    assert len(set(colours)) == len(set(map(on_dark, colours))) == count


def test_colours_are_visible_on_a_dark_ground_and_distinct():
    colours = [on_dark(colour) for colour in theme.LAW_COLOURS.values()]
    for place, colour in enumerate(colours):
        # Of 441 from black to white; the nearest two laws differ by 44, the nearest to the ground by 120.
        assert math.dist(colour, theme.BACKGROUND) > 120
        assert all(math.dist(colour, other) > 40 for other in [*colours[:place], theme.DESIRED_TRACE])


def test_what_is_bright_stays_as_it_is():
    assert on_dark("#e69f00") == (0xE6, 0x9F, 0x00)
