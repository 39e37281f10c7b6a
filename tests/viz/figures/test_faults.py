"""Figures of the fault study: shares, pairs and points where they should be, and crosses above the bound."""

import numpy as np
import pytest
from matplotlib.image import imread

from spheretwin.viz.figures import faults, style

SHARES = {"told": {1: 1.0, 2: 0.9, 9: 0.4}, "not told": {1: 0.6, 2: 0.3}}
TRIANGLE = np.array([[1.0, np.nan, np.nan], [2.5, 1.5, np.nan], [np.nan, 8.0, 2.0]])
POINTS = {"told": [(0.5, 3.0, 9), (1.5, 1.0, 1), (np.nan, 1.0, 2)], "bounded": [(0.5, 1.2, 9)]}


def shares():
    return faults.shares(SHARES, "open groups", "runs that track, %", "shares")


def remaining():
    return faults.remaining({"open": [4e-3, 5e-3, 0.2, np.inf]}, "time, s", "not detected, %", "latency")


def triangles():
    return faults.triangles({"told": TRIANGLE, "not told": TRIANGLE}, "group", "ratio", 2.0, "pairs")


def clouds():
    return faults.clouds(POINTS, ("torque", "error", "groups"), (1.0, 2.0), "clouds")


@pytest.mark.parametrize("draw", [shares, remaining, triangles, clouds])
def test_figure_is_drawn_and_the_same_figure_gives_the_same_bytes(tmp_path, draw):
    paths = [tmp_path / "a.png", tmp_path / "b.png"]
    for path in paths:
        style.save(draw(), path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    inked = np.any(imread(paths[0])[:, :, :3] < 0.9, axis=2)
    assert 0.003 < inked.mean() < 0.8


def test_shares_are_in_percent_over_the_numbers_that_were_run():
    (axes,) = shares().axes
    lines = {line.get_label(): line for line in axes.get_lines()}
    np.testing.assert_allclose(lines["told"].get_ydata(), [100, 90, 40])
    assert list(lines["not told"].get_xdata()) == [1, 2]
    assert list(axes.get_xticks()) == [1, 2, 9]
    assert len({line.get_color() for line in lines.values()}) == 2


def test_crosses_are_above_the_bound_and_on_no_empty_square():
    left, right, _ = triangles().axes
    for axes in (left, right):
        (crosses,) = axes.collections
        assert sorted(map(tuple, crosses.get_offsets().tolist())) == [(0.0, 1.0), (1.0, 2.0)]
        shown = axes.images[0].get_array()
        np.testing.assert_array_equal(np.ma.getmaskarray(shown), np.isnan(TRIANGLE))


def test_one_scale_of_colours_for_all_panels_that_begins_at_one():
    left, right, _ = triangles().axes
    assert left.images[0].norm is right.images[0].norm
    assert (left.images[0].norm.vmin, left.images[0].norm.vmax) == (1.0, 8.0)
    small = faults.triangles({"told": TRIANGLE / 8}, "group", "ratio", 2.0, "pairs").axes[0].images[0].norm
    assert (small.vmin, small.vmax) == (1 / 8, 4.0)  # twice the bound is always on it


def test_points_without_numbers_are_left_out_and_bounds_are_dashed():
    left, right, _ = clouds().axes
    assert left.collections[0].get_offsets().tolist() == [[0.5, 3.0], [1.5, 1.0]]
    assert len(right.collections[0].get_offsets()) == 1
    for axes in (left, right):
        dashed = [line for line in axes.get_lines() if line.get_linestyle() == "--"]
        assert len(dashed) == 2
        assert (dashed[0].get_xdata()[0], dashed[1].get_ydata()[0]) == (1.0, 2.0)
        assert axes.get_xscale() == axes.get_yscale() == "log"


def test_panels_without_a_point_or_a_square_are_drawn_too(tmp_path):
    empty = faults.triangles({"told": np.full((3, 3), np.nan)}, "group", "ratio", 2.0, "pairs")
    style.save(empty, tmp_path / "empty.png")
    cloud = faults.clouds({"told": [(0.5, 3.0, 9)]}, ("torque", "error", "groups"), (1.0, 2.0), "clouds")
    style.save(cloud, tmp_path / "cloud.png")


def test_a_panel_without_a_finite_point_is_empty():
    panels = {"told": [(0.5, 3.0, 9)], "detecting": [(0.5, np.inf, 9), (np.nan, 1.0, 9)]}
    reported_panel, detecting, _ = faults.clouds(
        panels, ("torque", "error", "groups"), (1.0, 2.0), "clouds"
    ).axes
    assert len(reported_panel.collections[0].get_offsets()) == 1
    assert len(detecting.collections[0].get_offsets()) == 0


def test_what_remains_falls_at_each_time_and_ends_at_what_never_comes():
    figure = faults.remaining({"open": [0.004, 0.005, 0.2, np.inf]}, "s", "%", "latency")
    (line,) = figure.axes[0].get_lines()
    np.testing.assert_allclose(line.get_xdata(), [0.004, 0.005, 0.2, 0.2])
    np.testing.assert_allclose(line.get_ydata(), [75, 50, 25, 25])


def test_what_remains_can_be_drawn_where_nothing_comes():
    figure = faults.remaining({"open": [np.inf]}, "s", "%", "latency")
    assert len(figure.axes[0].get_lines()) == 1


def test_axes_of_points_squares_and_shares_have_their_labels():
    left, right, bar = clouds().axes
    assert [axes.get_xlabel() for axes in (left, right)] == ["torque", "torque"]
    assert (left.get_ylabel(), bar.get_ylabel()) == ("error", "groups")
    assert [axes.get_title() for axes in (left, right)] == list(POINTS)
    left, right, bar = triangles().axes
    assert [left.get_xlabel(), left.get_ylabel(), right.get_xlabel()] == ["group"] * 3
    assert bar.get_ylabel() == "ratio"
    assert (shares().axes[0].get_xlabel(), shares().axes[0].get_ylabel()) == (
        "open groups",
        "runs that track, %",
    )


def test_points_have_the_colour_of_their_number_which_the_bar_names():
    left, right, bar = clouds().axes
    for axes, numbers in ((left, [9, 1]), (right, [9])):
        (cloud,) = axes.collections
        assert cloud.get_array().tolist() == numbers
        colours = cloud.get_cmap()(cloud.norm(numbers))
        np.testing.assert_allclose(cloud.to_rgba(cloud.get_array()), colours)
    assert [text.get_text() for text in bar.get_yticklabels()] == ["1", "2", "9"]
    shown = left.collections[0].norm
    # A tick stands in the middle of the colour of its number.
    for tick, number in zip(bar.get_yticks(), (1, 2, 9), strict=True):
        assert shown(tick) == shown(number)
    assert clouds().get_suptitle() == "clouds"


def test_squares_have_ticks_at_every_third_group_and_a_bar_in_plain_numbers():
    left, right, bar = faults.triangles(
        {"told": np.ones((7, 7)), "not told": 10 * np.ones((7, 7))}, "group", "ratio", 2.0, "pairs"
    ).axes
    assert [list(axes.get_xticks()) for axes in (left, right)] == [[0, 3, 6]] * 2
    assert list(left.get_yticks()) == [0, 3, 6]
    assert [text.get_text() for text in bar.get_yticklabels()] == ["1", "1.5", "2", "3", "4", "6", "8", "10"]
    assert [axes.get_title() for axes in (left, right)] == ["told", "not told"]
    dark, light = (axes.collections[0].get_edgecolor() for axes in triangles().axes[:2])
    assert len(dark) == len(light) == 2


def test_lines_of_shares_and_of_what_remains_are_named_and_on_their_scales():
    (axes,) = shares().axes
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["told", "not told"]
    assert [line.get_color() for line in axes.get_lines()] == list(style.SERIES[:2])
    assert axes.get_ylim()[0] < 0 < 100 < axes.get_ylim()[1]
    assert axes.get_title() == "shares"
    (axes,) = faults.remaining({"open": [4e-3], "stuck": [0.1, np.inf]}, "s", "%", "latency").axes
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert [line.get_color() for line in axes.get_lines()] == list(style.SERIES[:2])
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["open", "stuck"]
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_title()) == ("s", "%", "latency")
