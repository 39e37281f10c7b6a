"""Figures of tracking errors: a colour a law, the paper's figures, gaps where runs have ended."""

import numpy as np
import pytest
from matplotlib.colors import to_hex

from spheretwin.control.laws import LAWS
from spheretwin.viz import theme
from spheretwin.viz.figures import maps, over_time, style

WINDOWS = 0.1 + np.linspace(0, 1, 40)[None, :, None] + 0.1 * np.arange(3)[:, None, None] * np.ones((1, 1, 2))
SIZES = np.array([0.1, 0.3, 0.2])
ROWS, COLUMNS = ["ideal", "all"], ["pd", "afsm"]


def courses(windows=WINDOWS):
    by_label = {
        "AFSM": over_time.ErrorCourse("afsm", windows, 0.12, (0,)),
        "PID": over_time.ErrorCourse("pid", windows, 0.0, ()),
    }
    return over_time.courses(by_label, 0.02, ("α", "β"), "courses")


def lines():
    line = over_time.ErrorLine("as printed", SIZES, 0.5 * SIZES)
    groups = [
        over_time.ErrorGroup("afsm", "AFSM", [line, line._replace(label="as acceleration")], 0.12),
        over_time.ErrorGroup("pid", "PID", [line], None),
    ]
    return over_time.lines(groups, "largest |error|, degrees", "lines")


def heated():
    values = np.array([[0.1, 9.0], [np.nan, 0.3]])
    panels = {"α": maps.HeatPanel(values, values - 0.2), "β": maps.HeatPanel(values, 0 * values)}
    return maps.heat(panels, ROWS, COLUMNS, "heat", "change, degrees")


def test_error_bands_show_the_median_in_the_colour_of_the_law():
    above, below = courses().axes
    (median,) = [line for line in above.get_lines() if line.get_label() == "AFSM"]
    assert median.get_color() == theme.law_colour("afsm")
    np.testing.assert_allclose(median.get_ydata(), np.median(WINDOWS[:, :, 0], axis=0))
    np.testing.assert_allclose(median.get_xdata()[:2], [0.01, 0.03])  # middles of the windows
    dotted = [[line for line in axes.get_lines() if line.get_linestyle() == ":"] for axes in (above, below)]
    assert [len(each) for each in dotted] == [1, 0]
    assert set(dotted[0][0].get_ydata()) == {0.12}


def test_error_bands_end_with_the_first_run():
    ended = WINDOWS.copy()
    ended[1, 25:] = np.nan
    (median,) = [line for line in courses(ended).axes[0].get_lines() if line.get_label() == "AFSM"]
    assert len(median.get_xdata()) == 25


def test_lines_show_median_and_range():
    figure = lines()
    dots = [line for line in figure.axes[0].get_lines() if line.get_marker() == "o"]
    assert [float(dot.get_xdata()[0]) for dot in dots] == pytest.approx([0.2, 0.1, 0.2, 0.1])
    ranges = [
        line for line in figure.axes[0].get_lines() if len(line.get_xdata()) == 2 and line.get_marker() != "o"
    ]
    assert list(ranges[0].get_xdata()) == [0.1, 0.3]
    assert [label.get_text() for label in figure.axes[0].get_yticklabels()] == [
        "as printed",
        "as acceleration",
    ]
    assert figure.axes[0].get_ylim() == (1.5, -0.5)  # the first at the top


def test_heat_writes_what_is_a_number():
    written = [text.get_text() for text in heated().axes[0].texts]
    assert written == ["0.100", "9.00", "0.300"]


@pytest.mark.parametrize(("columns", "side_by_side"), [(5, True), (6, False)])
def test_panels_of_many_columns_are_one_below_the_other(columns, side_by_side):
    panel, names = (
        maps.HeatPanel(np.zeros((2, columns)), np.zeros((2, columns))),
        [str(i) for i in range(columns)],
    )
    figure = maps.heat({"α": panel, "β": panel}, ROWS[:2], names, "heat", "change, degrees")
    first, second = (axes.get_subplotspec() for axes in figure.axes[:2])
    assert (first.rowspan == second.rowspan) == side_by_side
    assert (first.colspan == second.colspan) != side_by_side


def test_laws_have_colours_of_their_own_or_share_the_last():
    assert set(theme.LAW_COLOURS) <= set(LAWS)
    colours = [theme.law_colour(law) for law in theme.LAW_COLOURS]
    assert len(set(colours)) == len(colours)
    assert all(to_hex(colour) == colour for colour in colours)
    assert theme.law_colour("one of the user's") == theme.OTHER_LAW not in colours


def test_the_legend_of_lines_names_filled_and_hollow_dots_and_the_paper():
    figure = lines()
    (legend,) = figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts == ["measured", "true", "the paper's figure"]
    measured, true, paper = legend.get_lines()
    assert (measured.get_markerfacecolor(), true.get_markerfacecolor()) == (style.INK, "white")
    assert paper.get_linestyle() == ":"
    filled, hollow = (dot for dot in figure.axes[0].get_lines()[:4] if dot.get_marker() == "o")
    # The first line is the measured one: its sizes are twice those of the true one.
    assert (filled.get_xdata(), hollow.get_xdata()) == ([pytest.approx(0.2)], [pytest.approx(0.1)])
    assert (filled.get_markerfacecolor(), hollow.get_markerfacecolor()) == (theme.law_colour("afsm"), "white")
    printed = [
        line
        for line in figure.axes[0].get_lines()
        if line.get_linestyle() == ":" and len(line.get_xdata()) == 2
    ]
    assert [set(line.get_xdata()) for line in printed] == [{0.12}]
    assert figure.axes[-1].get_xlabel() == "largest |error|, degrees"


def test_error_bands_reach_from_the_least_to_the_largest_of_the_seeds():
    (band, _) = courses().axes[0].collections
    points = band.get_paths()[0].vertices
    errors = WINDOWS[:, :, 0]
    for window in (0, 20, 39):
        inside = points[np.isclose(points[:, 0], 0.02 * (window + 0.5)), 1]
        assert (inside.min(), inside.max()) == pytest.approx(
            (errors[:, window].min(), errors[:, window].max())
        )


def test_heat_is_blue_for_less_and_red_for_more_on_one_scale():
    figure = heated()
    left, right = (axes.get_images()[0] for axes in figure.axes[:2])
    less, zero, more = left.get_cmap()(left.norm([-0.1, 0.0, 0.1]))
    assert less[2] > less[0] + 0.25
    assert more[0] > more[2] + 0.25
    assert np.ptp(zero[:3]) < 0.02
    assert left.norm is right.norm
    np.testing.assert_allclose(left.get_array()[0], [-0.1, 0.1])  # changes beyond the scale are its ends
    assert figure.axes[2].get_ylabel() == "change, degrees"
    ticks = [text.get_text() for text in figure.axes[2].get_yticklabels()]
    assert ticks == ["-0.1", "-0.03", "-0.01", "0", "+0.01", "+0.03", "+0.1"]


def test_error_bands_name_axis_unit_and_law():
    figure = courses()
    assert [axes.get_ylabel() for axes in figure.axes] == ["|error| of α, degrees", "|error| of β, degrees"]
    assert figure.axes[-1].get_xlabel() == "time, s"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["AFSM", "PID"]
