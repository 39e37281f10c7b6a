"""Colours of runs: by law where that tells them apart, and seen on a dark ground."""

import math

import pytest

from spheretwin.viz import palette
from spheretwin.viz.compared.colours import on_dark, run_colours


def test_a_law_has_its_colour_and_another_run_of_it_another():
    colours = run_colours(["afsm", "pd", "afsm", "mine.py:Mine"])
    assert colours[:2] == [palette.LAW_COLOURS["afsm"], palette.LAW_COLOURS["pd"]]
    assert colours[2] in palette.SPARE
    assert colours[3] == palette.OTHER_LAW


@pytest.mark.parametrize("count", [2, 5, 6, 7, 30])
def test_no_two_runs_of_one_law_have_one_colour(count):
    assert len(set(run_colours(["afsm"] * count))) == count


def test_all_are_seen_on_a_dark_ground_and_told_apart():
    colours = [on_dark(colour) for colour in palette.LAW_COLOURS.values()]
    grounds = [palette.BACKGROUND, palette.DESIRED_TRACE]
    for place, colour in enumerate(colours):
        # Of 441 from black to white: text and lines of a third of it stand out; hues of a tenth differ.
        assert math.dist(colour, palette.BACKGROUND) > 147
        assert all(math.dist(colour, other) > 30 for other in [*colours[:place], grounds[1]])
