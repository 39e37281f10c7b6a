"""Conditions that content of figures does not draw: outside values, no values, limits, unwritable files."""

import numpy as np
import pytest

from spheretwin.models.base.errors import InputError
from spheretwin.viz.figures import comparison, conditions, faults, fronts, maps, over_time, style
from tests.viz.comparison.compared import RAMP, VALUE, T_s, run_of
from tests.viz.figures import figure_builders as built
from tests.viz.figures.figure_builders import OBJECTIVES, TRIALS

LAWS = ("pd", "pid", "adaptive_fuzzy", "afsm", "new_one", "other_new_one")


def marks_of(panel, marker):
    return [line.get_xydata().tolist() for line in panel.get_lines() if line.get_marker() == marker]


def test_the_mark_of_a_failed_run_is_within_the_range_that_is_that_of_the_other():
    settled = 0.01 * np.sin(40 * T_s) + np.where(T_s < 0.3, 2.0, 0.0)
    failed = np.where(T_s < 1.9, 0.005, 30.0)[:2000]
    runs = [run_of(settled, "1 first"), run_of(failed, "2 other", status="left workspace")]
    linear, logarithmic = comparison.over_time(runs, [], [VALUE._replace(group="whole")], "title").axes
    top = linear.get_ylim()[1]
    assert top < 0.02
    assert marks_of(linear, "X") == [[[pytest.approx(1.999), top]]]  # at the edge of the range
    assert marks_of(logarithmic, "X") == [[[pytest.approx(1.999), 30.0]]]


def test_the_legend_is_below_the_panels():
    eight = [run_of(RAMP, f"{i} run: pd, L {i}") for i in range(1, 9)]
    figure = comparison.over_time(eight, [], [VALUE], "title")
    figure.draw_without_rendering()
    (legend,) = figure.legends
    assert len(legend.get_texts()) == 8
    assert legend.get_window_extent().y0 >= 0
    assert legend.get_window_extent().y1 <= min(axes.get_tightbbox().y0 for axes in figure.axes)


def test_error_bands_end_with_the_first_run():
    ended = built.WINDOWS.copy()
    ended[1, 25:] = np.nan
    (median,) = [line for line in built.courses(ended).axes[0].get_lines() if line.get_label() == "AFSM"]
    assert len(median.get_xdata()) == 25


@pytest.mark.parametrize(("columns", "side_by_side"), [(5, True), (6, False)])
def test_panels_of_many_columns_are_one_below_the_other(columns, side_by_side):
    panel = maps.HeatPanel(np.zeros((2, columns)), np.zeros((2, columns)))
    figure = maps.heat({"α": panel, "β": panel}, ["a", "b"], list("123456"[:columns]), "heat", "degrees")
    first, second = (axes.get_subplotspec() for axes in figure.axes[:2])
    assert (first.rowspan == second.rowspan, first.colspan == second.colspan) == (
        side_by_side,
        not side_by_side,
    )


def test_the_scale_of_pairs_has_twice_the_bound_and_their_ticks_are_every_third_group():
    (axes, _) = faults.triangles({"told": built.TRIANGLE / 8}, "group", "ratio", 2.0, "pairs").axes
    assert (axes.images[0].norm.vmin, axes.images[0].norm.vmax) == (1 / 8, 4.0)
    (axes, _) = faults.triangles({"told": np.ones((7, 7))}, "group", "ratio", 2.0, "pairs").axes
    assert list(axes.get_xticks()) == list(axes.get_yticks()) == [0, 3, 6]


LABELS = ("torque", "error", "groups")
LOST = TRIALS._replace(
    completed=np.zeros(6, bool),
    best=np.zeros(6, bool),
    values=np.full((6, 2), np.nan),
    fresh=np.empty((0, 2)),
)
WITHOUT_VALUES = {
    "pairs": lambda: faults.triangles({"told": np.full((3, 3), np.nan)}, "group", "ratio", 2.0, "pairs"),
    "points": lambda: faults.clouds(
        {"told": [(0.5, 3.0, 9)], "detecting": [(0.5, np.inf, 9), (np.nan, 1.0, 9)]}, LABELS, (1.0, 2.0), "t"
    ),
    "times": lambda: faults.remaining({"open": [np.inf]}, "s", "%", "latency"),
    "trials": lambda: fronts.progress({"pid": LOST}, OBJECTIVES, "nothing"),
    "front": lambda: fronts.front({"pid": LOST}, OBJECTIVES, "nothing"),
}


@pytest.mark.parametrize("name", WITHOUT_VALUES)
def test_a_figure_without_a_finite_value_is_drawn(name):
    WITHOUT_VALUES[name]().draw_without_rendering()


@pytest.mark.parametrize(("largest", "top"), [(9.0, 9.0), (3000.0, 30.0)])
def test_axes_of_a_front_reach_to_the_largest_value_or_thirty_times_the_least(largest, top):
    values = np.array([[1.0, 2.0], [3.0, 6.0], [largest, 4.0]])
    some = TRIALS._replace(numbers=np.arange(3.0), values=values, completed=np.ones(3, bool),
                           best=np.array([True, False, False]), fresh=np.empty((0, 2)))  # fmt: skip
    panel = fronts.front({"pid": some}, OBJECTIVES, "front").axes[0]
    assert panel.get_xlim() == pytest.approx((1 / 1.15, 1.15 * top))
    assert panel.get_ylim() == pytest.approx((2 / 1.15, 1.15 * 6))


def test_laws_are_distinct_without_colour():
    looks = style.styles(LAWS)
    for of_one in (lambda look: look.colour, lambda look: look.marker):
        assert len({of_one(look) for look in looks.values()}) == len(LAWS)
    assert style.styles(("afsm",))["afsm"] == looks["afsm"]  # whatever stands next to it


def test_paths_are_on_the_same_scales():
    turn = np.linspace(0, 6, 50)
    path = np.stack([90 * np.cos(turn), 20 * np.sin(turn), 100 + turn], axis=1)
    by_label = {
        "AFSM": over_time.TipPath("afsm", path, path, True),
        "PD": over_time.TipPath("pd", path[:9], path, False),
    }
    spaces, plans = (over_time.paths(by_label, "title").axes[first::2] for first in (0, 1))
    assert plans[0].get_xlim() == plans[1].get_xlim()
    assert spaces[0].get_zlim() == spaces[1].get_zlim()


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_the_same_figure_gives_the_same_bytes(tmp_path, suffix):
    results = []
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        style.save(built.tip_paths(), path := tmp_path / name / f"paths.{suffix}")
        results.append(path.read_bytes())
    assert results[0] == results[1]
    assert (b"<svg" in results[0]) == (suffix == "svg")


def test_a_figure_that_cannot_be_written_is_bad_input(tmp_path):
    with pytest.raises(InputError, match="writable path"):
        style.save(built.margins(), tmp_path / "missing" / "figure.png")


FREQUENCY_Hz = np.array([1.0, 10.0, 100.0, 500.0])


def test_lines_and_markers_have_gain_and_phase_and_a_zero_is_left_out():
    linear = np.array([10.0, 1.0, -0.1j, -0.01])
    measured = np.array([10.0, 1.0, -0.1j, 1e-12 + 0j])  # no gain at half of the sampling rate
    figure = conditions.bode({"pid": (FREQUENCY_Hz, measured, linear)}, {"pid": "PID"}, "loop")
    gain, phase = ([curve.get_ydata() for curve in axes.lines[:2]] for axes in figure.axes)
    assert gain[0] == pytest.approx([20.0, 0.0, -20.0, -40.0])
    assert gain[1] == pytest.approx([20.0, 0.0, -20.0, np.nan], nan_ok=True)
    assert np.diff(phase[0]) == pytest.approx([0.0, -90.0, -90.0])
    assert np.isnan(phase[1]).tolist() == [False, False, False, True]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "PID",
        "linear model of the sampled loop",
        "measured",
    ]
