"""Paths of the shaft's tip: coordinates, colours, labels, and marks of start and early end."""

import numpy as np

from spheretwin.viz import theme
from spheretwin.viz.figures.over_time import TipPath, paths
from spheretwin.viz.figures.style import INK

TIP = np.array([[1.0, 2.0, 30.0], [4.0, -5.0, 31.0], [7.0, 8.0, 32.0]])
DESIRED = TIP + [0.5, 0.25, 0.125]


def figure_of_paths():
    return paths(
        {"PD": TipPath("pd", TIP, DESIRED, False), "AFSM": TipPath("afsm", TIP, DESIRED, True)}, "title"
    )


def test_paths_are_drawn_in_space_and_from_above():
    figure = figure_of_paths()
    for place, law in enumerate(("pd", "afsm")):
        space, plan = figure.axes[2 * place : 2 * place + 2]
        for axes, size in ((space, 3), (plan, 2)):
            actual, desired, start = axes.get_lines()[:3]
            data = [line.get_data_3d() if size == 3 else line.get_data() for line in (actual, desired, start)]
            np.testing.assert_array_equal(data[0], TIP.T[:size])
            np.testing.assert_array_equal(data[1], DESIRED.T[:size])
            np.testing.assert_array_equal(data[2], TIP[:1].T[:size])
            assert actual.get_color() == theme.law_colour(law)
            assert (desired.get_color(), start.get_marker()) == (INK, "o")
        assert (space.get_xlabel(), space.get_ylabel(), space.get_zlabel()) == ("x, mm", "y, mm", "z, mm")
        assert space.get_title() == f"({'ab'[place]}) {('PD', 'AFSM')[place]}"
        assert plan.get_xlabel() == "x, mm"
        assert plan.get_xlim() == (-1.25 * 7.5, 1.25 * 7.5)
        assert plan.get_ylim() == (-1.25 * 8.25, 1.25 * 8.25)
    assert figure.axes[1].get_ylabel() == "y, mm"


def test_an_early_end_is_a_cross_at_the_last_tip():
    figure = figure_of_paths()
    crosses = [
        line for line in figure.axes[1].get_lines() if line.get_marker() == "x" and len(line.get_xdata())
    ]
    assert [line.get_xydata().tolist() for line in crosses] == [[[7.0, 8.0]]]
    assert not [
        line for line in figure.axes[3].get_lines() if line.get_marker() == "x" and len(line.get_xdata())
    ]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "actual, in the colour of its law",
        "desired",
        "start",
        "ended early",
    ]
