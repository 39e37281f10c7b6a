"""Figures of how laws track: what is drawn where, in both units, and the same bytes each time."""

import numpy as np
import pytest

from spheretwin.viz.figures import conditions, over_time, style
from spheretwin.viz.figures.style import styles
from spheretwin.viz.theme import law_colour

LAWS = ("pd", "pid", "adaptive_fuzzy", "afsm", "new_one", "other_new_one")
HINGES = ("α", "β", "γ")


def series(law, scale, whole=(True, True), paper=None):
    errors = scale * np.array([0.9, 1.0, 1.2])[:, None, None] * np.array([1.0, 2.0])[:, None] * np.ones(3)
    return conditions.ErrorsByCondition(law, np.array([0.0, 1.0]), errors, np.array(whole), paper or {})


def drawn():
    by_label = {
        "PD": series("pd", 0.1, (True, False)),
        "AFSM": series("afsm", 0.01, paper={1.0: (0.03, 0.04, 0.05)}),
    }
    return conditions.by_condition(by_label, HINGES, "load L", "largest |error|", "title")


def test_laws_are_distinct_without_colour():
    looks = styles(LAWS)
    assert len({look.colour for look in looks.values()}) == len(LAWS)
    assert len({(look.marker, look.dash) for look in looks.values()}) == len(LAWS)
    assert len({look.marker for look in looks.values()}) == len(LAWS)
    assert styles(("afsm",))["afsm"] == looks["afsm"]  # whatever stands beside it


def test_both_axes_have_the_same_errors():
    figure = drawn()
    left, right = figure.axes[2], figure.axes[3]
    np.testing.assert_allclose(np.radians(right.get_ylim()), 1e-3 * np.array(left.get_ylim()), rtol=1e-12)
    low, high = left.get_ylim()
    assert low < 1e3 * 0.9 * 0.01
    assert high > 1e3 * 1.2 * 2 * 0.1


def test_medians_and_printed_numbers_are_where_they_belong():
    panel = drawn().axes[1]
    lines = [np.asarray(line.get_ydata()) for line in panel.lines if line.get_label() == "AFSM"]
    np.testing.assert_allclose(lines[0], [10.0, 20.0])
    bars = [line for line in panel.lines if line.get_marker() == "_" and len(line.get_ydata()) == 1]
    assert {float(line.get_ydata()[0]) for line in bars} == {40.0}  # β's


def test_what_ended_early_is_hollow():
    inside = {
        (line.get_markeredgecolor(), line.get_markerfacecolor())
        for line in drawn().axes[0].lines
        if line.get_linestyle() == "None" and len(line.get_xdata())
    }
    assert (law_colour("pd"), "white") in inside
    assert (law_colour("afsm"), "white") not in inside
    assert (law_colour("afsm"), law_colour("afsm")) in inside
    assert any(text.get_text() == "ended early" for text in drawn().legends[0].get_texts())


def test_a_line_of_an_early_end_has_a_cross():
    by_label = {
        "PD": over_time.ErrorBand("pd", np.full((2, 3, 3), 0.5)),
        "AFSM": over_time.ErrorBand("afsm", np.full((2, 8, 3), 0.01)),
    }
    panel = over_time.errors(by_label, 0.05, HINGES, "title").axes[0]
    (cross,) = [line for line in panel.lines if line.get_marker() == "x" and len(line.get_xdata())]
    assert float(cross.get_xdata()[0]) == pytest.approx(0.05 * 2.5)
    assert float(cross.get_ydata()[0]) == pytest.approx(500.0)


def test_paths_are_on_the_same_scales():
    turn = np.linspace(0, 6, 50)
    path = np.stack([90 * np.cos(turn), 20 * np.sin(turn), 100 + turn], axis=1)
    by_label = {
        "AFSM": over_time.TipPath("afsm", path, path, True),
        "PD": over_time.TipPath("pd", path[:9], path, False),
    }
    figure = over_time.paths(by_label, "title")
    spaces, plans = figure.axes[::2], figure.axes[1::2]
    assert {axes.name for axes in spaces} == {"3d"}
    assert plans[0].get_xlim() == plans[1].get_xlim()
    assert spaces[0].get_zlim() == spaces[1].get_zlim()
    crosses = [[line for line in axes.lines if line.get_marker() == "x" and len(line.get_xdata())]
               for axes in plans]  # fmt: skip
    assert [len(each) for each in crosses] == [0, 1]


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_the_same_figure_gives_the_same_bytes(tmp_path, suffix):
    results = []
    for folder in ("one", "other"):
        (tmp_path / folder).mkdir()
        path = tmp_path / folder / f"errors.{suffix}"
        style.save(drawn(), path)
        results.append(path.read_bytes())
    assert results[0] == results[1]
    assert (b"<svg" in results[0]) == (suffix == "svg")


def test_errors_over_time_are_medians_and_ranges_in_mrad():
    seeds = (
        np.array([0.1, 0.2, 0.4])[:, None, None] * np.array([1.0, 2.0])[:, None] * np.array([1.0, 3.0, 5.0])
    )
    figure = over_time.errors({"PD": over_time.ErrorBand("pd", seeds)}, 0.5, HINGES, "title")
    panels = [axes for axes in figure.axes if axes.get_ylabel().endswith("mrad")]
    assert [axes.get_ylabel() for axes in panels] == [f"|error| of {name}, mrad" for name in HINGES]
    for axes, factor in zip(panels, (1.0, 3.0, 5.0), strict=True):
        (line,) = (line for line in axes.get_lines() if line.get_label() == "PD")
        np.testing.assert_allclose(line.get_xdata(), [0.25, 0.75])
        np.testing.assert_allclose(line.get_ydata(), [200 * factor, 400 * factor])
        points = axes.collections[0].get_paths()[0].vertices
        at_first = points[np.isclose(points[:, 0], 0.25), 1]
        assert (at_first.min(), at_first.max()) == pytest.approx((100 * factor, 400 * factor))


def test_angles_are_drawn_with_their_references_by_law_and_hinge():
    t_s = np.linspace(0, 1, 5)
    q = np.stack([t_s, 2 * t_s, 3 * t_s], axis=1)
    by_label = {
        "PD": over_time.AngleTraces("pd", t_s[:3], q[:3], t_s, q + 0.5, False),
        "AFSM": over_time.AngleTraces("afsm", t_s, 2 * q, t_s, q + 0.25, True),
    }
    figure = over_time.angles(by_label, HINGES, "title")
    grid = np.array(figure.axes).reshape(3, 2)
    for column, (label, motion) in enumerate(by_label.items()):
        for hinge in range(3):
            actual, desired = grid[hinge, column].get_lines()[:2]
            np.testing.assert_array_equal(actual.get_xydata().T, [motion.t_s, motion.q_rad[:, hinge]])
            np.testing.assert_array_equal(desired.get_xydata().T, [t_s, motion.desired_rad[:, hinge]])
            assert actual.get_color() == law_colour(motion.law)
            assert desired.get_color() == style.INK
        assert grid[0, column].get_title() == f"({'ab'[column]}) {label}"
    assert [axes.get_ylabel() for axes in grid[:, 0]] == ["α, rad", "β, rad", "γ, rad"]
    (cross,) = [line for line in grid[1, 0].get_lines() if line.get_marker() == "x"]
    assert cross.get_xydata().tolist() == [[0.5, 1.0]]
    assert "ended early" in [text.get_text() for text in figure.legends[0].get_texts()]
