"""Figures of a tuning: what is drawn is what was found, as often as it was found."""

import numpy as np
import pytest

from spheretwin.viz.figures import fronts, style
from spheretwin.viz.theme import law_colour

TRIALS = fronts.Trials(
    law="pid",
    numbers=np.arange(6.0),
    values=np.array([[3.0, 1.0], [2.0, 5.0], [np.nan, np.nan], [9.0, 9.0], [1.0, 6.0], [4.0, 8.0]]),
    completed=np.array([True, True, False, False, True, True]),
    best=np.array([True, True, False, False, True, False]),
    signs=np.array([1.0, 1.0]),
    has_start=True,
    fresh=np.array([[1.5, 6.5], [2.5, 5.5]]),
)
OBJECTIVES = ("worst error", "worst variation")


def drawn(panel):
    """Points of each series by its label."""
    return {line.get_label(): np.array(line.get_data()).T for line in panel.get_lines()}


def test_every_trial_is_drawn_once_and_the_best_so_far_only_gets_better(tmp_path):
    figure = fronts.progress({"pid": TRIALS}, OBJECTIVES, "trials")
    for place, panel in enumerate(figure.axes):
        series = drawn(panel)
        counts = {name.partition(", ")[2]: len(points) for name, points in series.items()}
        assert counts == {"completed": 4, "pruned: at least": 1, "lost": 1, "best so far": 6}
        best = series["pid, best so far"][:, 1]
        assert np.all(np.diff(best) <= 0)
        assert best[-1] == np.nanmin(TRIALS.values[TRIALS.completed, place])
    style.save(figure, tmp_path / "trials.png")


def test_of_what_is_to_be_large_the_best_so_far_grows():
    figure = fronts.progress({"pid": TRIALS._replace(signs=np.array([-1.0, -1.0]))}, OBJECTIVES, "trials")
    best = drawn(figure.axes[0])["pid, best so far"][:, 1]
    np.testing.assert_array_equal(best, [3, 3, 3, 3, 3, 4])


def test_the_front_is_drawn_with_its_start_and_its_fresh_seeds(tmp_path):
    figure = fronts.front({"pid": TRIALS}, OBJECTIVES, "front")
    series = drawn(figure.axes[0])
    np.testing.assert_array_equal(series["pid, trial"], TRIALS.values[TRIALS.completed])
    np.testing.assert_array_equal(series["pid, front"], [[1, 6], [2, 5], [3, 1]])
    np.testing.assert_array_equal(series["pid, front under fresh seeds"], TRIALS.fresh)
    np.testing.assert_array_equal(series["pid, start"], [[3, 1]])
    style.save(figure, tmp_path / "front.png")


@pytest.mark.parametrize("kind", ["progress", "front"])
def test_without_a_completed_trial_there_is_still_a_figure(tmp_path, kind):
    none = np.zeros(6, dtype=bool)
    lost = TRIALS._replace(completed=none, best=none, values=np.full((6, 2), np.nan), fresh=np.empty((0, 2)))
    figure = getattr(fronts, kind)({"pid": lost}, OBJECTIVES, "nothing")
    style.save(figure, tmp_path / "nothing.png")
    assert (tmp_path / "nothing.png").stat().st_size > 0


def test_axes_of_tunings_have_the_names_of_their_objectives():
    panel = fronts.front({"pid": TRIALS}, OBJECTIVES, "front").axes[0]
    assert (panel.get_xlabel(), panel.get_ylabel(), panel.get_title()) == (*OBJECTIVES, "front")
    figure = fronts.progress({"pid": TRIALS}, OBJECTIVES, "trials")
    assert [axes.get_ylabel() for axes in figure.axes] == list(OBJECTIVES)
    assert figure.axes[-1].get_xlabel() == "trial"


def test_the_legend_of_fronts_has_each_law_with_its_marks():
    values = np.array([[1.0, 3.0], [2.0, 1.0]])
    panel = fronts.FrontPanel("ideal", "error, mrad", {"pd": values, "afsm": 2 * values}, {})
    labels = {"pd": "PD", "afsm": "AFSM"}
    figure = fronts.fronts([panel], labels, "variation, A/s")
    (legend,) = figure.legends
    for (law, label), text, handle in zip(
        labels.items(), legend.get_texts(), legend.get_lines(), strict=True
    ):
        (drawn_line,) = (
            line
            for line in figure.axes[0].get_lines()
            if np.array_equal(line.get_xydata(), panel.by_law[law])
        )
        assert text.get_text() == label
        assert handle.get_color() == drawn_line.get_color() == law_colour(law)
        assert handle.get_marker() == drawn_line.get_marker()


@pytest.mark.parametrize(("largest", "top"), [(9.0, 9.0), (3000.0, 30.0)])
def test_axes_of_a_front_reach_to_the_largest_value_or_thirty_times_the_least(largest, top):
    values = np.array([[1.0, 2.0], [3.0, 6.0], [largest, 4.0]])
    some = TRIALS._replace(numbers=np.arange(3.0), values=values, completed=np.ones(3, bool),
                           best=np.array([True, False, False]), fresh=np.empty((0, 2)))  # fmt: skip
    panel = fronts.front({"pid": some}, OBJECTIVES, "front").axes[0]
    assert panel.get_xlim() == pytest.approx((1 / 1.15, 1.15 * top))
    assert panel.get_ylim() == pytest.approx((2 / 1.15, 1.15 * 6))


def test_fronts_of_conditions_show_errors_up_to_forty_times_the_least():
    values = np.array([[1.0, 0.5], [2.0, 15.0], [3.0, 25.0]])
    panel = fronts.FrontPanel("ideal", "error, mrad", {"pd": values}, {}, (0.25,))
    axes = fronts.fronts([panel], {"pd": "PD"}, "variation, A/s").axes[0]
    assert axes.get_ylim()[0] < 0.25
    assert 15.0 < axes.get_ylim()[1] < 25.0
    assert axes.get_xlim()[0] < 1.0
    assert 2.0 < axes.get_xlim()[1] < 3.0


def test_fronts_of_conditions_have_points_in_the_order_of_their_cost():
    values = np.array([[2.0, 1.0], [1.0, 3.0]])
    panel = fronts.FrontPanel("ideal", "error, mrad", {"pd": values}, {"best": ("pd", 1.0, 3.0)}, (0.5,))
    axes = fronts.fronts([panel], {"pd": "PD"}, "variation, A/s").axes[0]
    floor, front, marked = axes.get_lines()[:3]
    assert set(floor.get_ydata()) == {0.5}
    assert front.get_xydata().tolist() == [[1.0, 3.0], [2.0, 1.0]]
    assert marked.get_xydata().tolist() == [[1.0, 3.0]]
    assert [text.get_text() for text in axes.texts] == ["best"]
    assert (axes.get_title(), axes.get_ylabel(), axes.get_xlabel()) == (
        "ideal",
        "error, mrad",
        "variation, A/s",
    )
