"""Colours of runs: by law if these are distinct, and visible on every ground."""

import pytest

from spheretwin.viz import theme


def test_a_law_has_its_colour_and_another_run_of_it_another():
    colours = theme.run_colours(["afsm", "pd", "afsm", "mine.py:Mine"])
    assert colours[:2] == [theme.LAW_COLOURS["afsm"], theme.LAW_COLOURS["pd"]]
    assert colours[2] in theme.SPARE
    assert colours[3] == theme.OTHER_LAW


@pytest.mark.parametrize("law", ["afsm", "afsm_eso"])
@pytest.mark.parametrize("count", [2, 5, 6, 7, 30])
def test_no_two_runs_of_one_law_have_one_colour(law, count):
    assert len(set(theme.run_colours([law] * count))) == count
