"""Figures of studies: squares, lines, distributions, ranks and scatters show the numbers they are given."""

from itertools import pairwise

import numpy as np
import pytest
from matplotlib.colors import LogNorm, Normalize, to_hex

from spheretwin.viz import theme
from spheretwin.viz.figures import distributions, maps

VALUES = np.array([[1.0, 20.0, 3.0], [4.0, np.nan, 6.0]])
LOST = np.array([[False, True, False], [False, True, False]])
COLOURS = theme.law_colours(["pd", "afsm"])


def map_figure():
    panels = {"pd": maps.MapPanel(VALUES, LOST), "afsm": maps.MapPanel(2 * VALUES, np.zeros_like(LOST))}
    labels = (["low", "high"], ["a", "b", "c"])
    return maps.maps(panels, ("the rows", "the columns"), labels, "error, mrad", "title")


def test_squares_have_their_values_rows_from_below_and_names_of_both_axes():
    figure = map_figure()
    left, right = figure.axes[:2]
    for axes, factor in ((left, 1), (right, 2)):
        (image,) = axes.get_images()
        np.testing.assert_array_equal(image.get_array().filled(np.nan), factor * VALUES)
        assert image.origin == "lower"
        assert isinstance(image.norm, LogNorm)
        assert (image.norm.vmin, image.norm.vmax) == (1.0, 40.0)
        assert [text.get_text() for text in axes.get_xticklabels()] == ["a", "b", "c"]
        assert axes.get_xlabel() == "the columns"
    assert [text.get_text() for text in left.get_yticklabels()] == ["low", "high"]
    assert left.get_ylabel() == "the rows"
    assert right.get_ylabel() == ""
    assert [axes.get_title() for axes in (left, right)] == ["pd", "afsm"]
    assert [to_hex(axes.title.get_color()) for axes in (left, right)] == list(COLOURS.values())
    assert figure.axes[-1].get_ylabel() == "error, mrad"


def test_squares_write_their_numbers_and_cross_lost_runs():
    left, right = map_figure().axes[:2]
    written = {tuple(map(int, text.get_position())): text.get_text() for text in left.texts}
    expected = {(column, row): f"{VALUES[row, column]:.2g}" for row in range(2) for column in range(3)}
    del expected[1, 1]
    assert written == expected
    crosses = [(int(line.get_xdata()[0]), int(line.get_ydata()[0])) for line in left.get_lines()]
    assert crosses == [(1, 0), (1, 1)]
    assert len(right.get_lines()) == 0
    assert map_figure().get_suptitle() == "title\n× not all runs completed"


def test_a_narrow_range_has_a_linear_scale():
    figure = maps.maps(
        {"pd": maps.MapPanel(1 + 0.1 * VALUES / 20, LOST)}, ("r", "c"), (["1", "2"], list("abc")), "q", "t"
    )
    (image,) = figure.axes[0].get_images()
    assert type(image.norm) is Normalize


def test_lines_have_median_range_and_crosses_where_runs_are_lost():
    x = np.array([1.0, 2.0, 4.0])
    line = maps.StudyLine(np.array([1.0, 2.0, 3.0]), np.array([0.5, 1.5, 2.0]), np.array([1.5, 2.5, 4.5]),
                          np.array([False, False, True]))  # fmt: skip
    axes = maps.lines({"pd": line}, x, "load, N·m", "error, mrad", "title").axes[0]
    median, cross = axes.get_lines()[:2]
    assert list(median.get_xdata()) == list(x)
    assert list(median.get_ydata()) == [1.0, 2.0, 3.0]
    assert median.get_color() == COLOURS["pd"]
    assert (list(cross.get_xdata()), list(cross.get_ydata())) == ([4.0], [3.0])
    band = axes.collections[0].get_paths()[0].vertices
    assert {(1.0, 0.5), (4.0, 2.0), (1.0, 1.5), (4.0, 4.5)} <= set(map(tuple, band))
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_title()) == ("load, N·m", "error, mrad", "title")
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["pd", "not all runs completed"]


def test_lines_over_names_have_these_at_their_ticks():
    line = maps.StudyLine(np.array([1.0, 2.0]), np.ones(2), 2 * np.ones(2), np.zeros(2, bool))
    axes = maps.lines({"pd": line}, ["hold", "tilt"], "scenario", "q", "t").axes[0]
    assert [text.get_text() for text in axes.get_xticklabels()] == ["hold", "tilt"]


def test_distributions_are_shares_of_all_rows():
    values = np.array([3.0, 1.0, 2.0])
    sheet = distributions.distributions(
        {"rms error, mrad": {"pd": values, "afsm": values + 10}}, {"pd": 4, "afsm": 3}, "title"
    )
    axes = sheet.axes[0]
    pd, afsm = axes.get_lines()[:2]
    assert list(pd.get_xdata()) == [1.0, 2.0, 3.0]
    assert list(pd.get_ydata()) == [0.25, 0.5, 0.75]  # one of four rows has no number
    assert list(afsm.get_ydata()) == pytest.approx([1 / 3, 2 / 3, 1.0])
    assert [line.get_color() for line in (pd, afsm)] == list(COLOURS.values())
    assert pd.get_drawstyle() == "steps-post"
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("rms error, mrad", "share of rows")
    assert axes.get_ylim() == (0, 1.02)
    named = dict(zip([text.get_text() for text in sheet.legends[0].get_texts()],
                     [line.get_color() for line in sheet.legends[0].get_lines()], strict=True))  # fmt: skip
    assert named == COLOURS


def test_ranks_are_bars_with_rings_and_the_band_of_chance():
    by_law = {
        "pd": distributions.Rank(np.array([0.9, -0.4]), np.array([0.1, 0.3]), 0.12, True),
        "afsm": distributions.Rank(np.array([0.5, 0.2]), np.array([-0.2, 0.0]), 0.2, True),
    }
    figure = distributions.ranks(["load", "gain"], by_law, "title")
    axes = figure.axes[0]
    for container, rings, (law, rank), shift in zip(
        axes.containers, axes.get_lines(), by_law.items(), (-0.19, 0.19), strict=False
    ):
        assert [bar.get_width() for bar in container] == list(rank.by_value)
        middles = [bar.get_y() + bar.get_height() / 2 for bar in container]
        assert middles == pytest.approx([shift, 1 + shift])
        assert to_hex(container[0].get_facecolor()) == COLOURS[law]
        assert list(rings.get_xdata()) == list(rank.by_distance)
        assert list(rings.get_ydata()) == pytest.approx(middles)
    (chance,) = [patch for patch in axes.patches if patch.get_label() == "by chance, 95 %"]
    assert (chance.get_x(), chance.get_width()) == (-0.2, 0.4)
    assert [text.get_text() for text in axes.get_yticklabels()] == ["load", "gain"]
    assert axes.get_ylim() == (1.5, -0.5)  # the strongest at the top
    assert axes.get_xlabel() == "partial rank correlation"


def test_scatters_have_every_row_and_the_median_of_tenths():
    x = np.arange(100.0)
    y = {"pd": x**2, "afsm": 5 + 0 * x}
    figure = distributions.scatters({"load": {"pd": x, "afsm": x}}, y, "error, mrad", "title")
    axes = figure.axes[0]
    dots, median = axes.get_lines()[:2]
    assert list(dots.get_xdata()) == list(x)
    assert list(dots.get_ydata()) == list(x**2)
    assert dots.get_color() == median.get_color() == COLOURS["pd"]
    edges = np.quantile(x, np.linspace(0, 1, 11))
    inside = [(x >= low) & (x <= high) for low, high in pairwise(edges)]
    np.testing.assert_allclose(median.get_xdata(), [np.median(x[rows]) for rows in inside])
    np.testing.assert_allclose(median.get_ydata(), [np.median(x[rows] ** 2) for rows in inside])
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("load", "error, mrad")
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["pd, median", "afsm, median"]
