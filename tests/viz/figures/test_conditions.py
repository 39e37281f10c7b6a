"""Figure of the estimators: measured and derived values, hidden lags, names."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from spheretwin.viz.figures import conditions
from spheretwin.viz.theme import law_colour

BANDWIDTHS = np.geomspace(20, 1000, 7)
CURVES = {
    "slow": conditions.Curve(
        BANDWIDTHS / 1e3, 1 / BANDWIDTHS, np.full(7, 1e-6), BANDWIDTHS / 2e3, 2 / BANDWIDTHS, 150.0
    ),
    "exact": conditions.Curve(
        BANDWIDTHS / 3e3, np.linspace(-1e-4, 1e-3, 7), np.full(7, 1e-4), BANDWIDTHS / 3e3, np.zeros(7), 800.0
    ),
}


def drawn() -> Figure:
    return conditions.estimators(BANDWIDTHS, CURVES, "rates")


@pytest.fixture
def figure() -> Figure:
    return drawn()


def test_axes_have_units_and_are_logarithmic(figure):
    above, below = figure.axes
    assert [above.get_ylabel(), below.get_ylabel()] == ["RMS error of the rate, rad/s", "lag of the rate, ms"]
    assert below.get_xlabel() == "bandwidth, rad/s"
    assert {axes.get_yscale() for axes in figure.axes} == {"log"}


def test_lag_within_noise_is_drawn_hollow_at_its_bound(figure):
    named = {line.get_label(): line for line in figure.axes[1].get_lines()}
    assert {"slow", "exact", "exact: at most"} <= set(named)
    assert "slow: at most" not in named
    hollow = named["exact: at most"]
    assert hollow.get_markerfacecolor() == "none"
    # Lags of -0.1 and 0.083 ms, with a deviation of 0.1 ms.
    np.testing.assert_allclose(hollow.get_ydata(), [0.2, 0.2 + 0.25 / 3], rtol=1e-12)
    assert len(named["exact"].get_ydata()) == 5


def test_each_estimator_keeps_its_colour_and_has_its_default(figure):
    for axes in figure.axes:
        lines = axes.get_lines()
        colours = {line.get_label().split(":")[0]: line.get_color() for line in lines}
        assert colours["slow"] == conditions.SERIES[0]
        assert colours["exact"] == conditions.SERIES[1]
        dashed = {line.get_color(): line.get_xdata()[0] for line in lines if line.get_linestyle() == "--"}
        assert dashed == {conditions.SERIES[0]: 150.0, conditions.SERIES[1]: 800.0}


def test_margins_are_errors_over_the_steps_with_the_bound_in_mrad():
    values = np.array([[1.0, 0.002, 1.0], [10.0, 0.02, 0.0]])
    panels = [
        conditions.MarginPanel("delay, ms", {"pd": values}),
        conditions.MarginPanel("gain", {"pd": values * [0.1, 1, 1]}),
    ]
    figure = conditions.margins(panels, {"pd": "PD"}, 0.01, "largest |error|, mrad", "title")
    left, right = figure.axes[:2]
    line, holds, fails, bound = left.get_lines()[:4]
    np.testing.assert_allclose(line.get_xydata(), [[1.0, 2.0], [10.0, 20.0]])
    np.testing.assert_allclose(holds.get_xydata(), [[1.0, 2.0]])
    np.testing.assert_allclose(fails.get_xydata(), [[10.0, 20.0]])
    assert fails.get_markerfacecolor() == "white" != holds.get_markerfacecolor()
    assert set(bound.get_ydata()) == {10.0}
    assert (left.get_xlabel(), right.get_xlabel()) == ("delay, ms", "gain")
    assert figure.get_supylabel() == "largest |error|, mrad"
    four = conditions.margins([*panels, *panels], {"pd": "PD"}, 0.01, "largest |error|, mrad", "title")
    assert [axes.get_visible() for axes in four.axes] == [True] * 4 + [False] * 2
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["PD", "does not hold"]


def test_ratios_have_a_row_each_with_their_range():
    rows = [
        conditions.RatioRow("one reading", {"pd": np.array([0.5, 2.0]), "afsm": np.array([1.0, 1.0])}),
        conditions.RatioRow("another", {"pd": np.array([3.0, 4.0]), "afsm": np.array([5.0, 6.0])}),
    ]
    figure = conditions.ratios(rows, {"pd": "PD", "afsm": "AFSM"}, "ours over printed", "title")
    axes = figure.axes[0]
    dots = [line for line in axes.get_lines() if line.get_marker() not in ("None", "")]
    assert [list(line.get_xdata()) for line in dots] == [[0.5, 2.0], [1.0, 1.0], [3.0, 4.0], [5.0, 6.0]]
    assert [round(float(np.mean(line.get_ydata()))) for line in dots] == [0, 0, 1, 1]
    assert dots[0].get_ydata()[0] < dots[1].get_ydata()[0]  # PD first in its row
    assert [text.get_text() for text in axes.get_yticklabels()] == ["one reading", "another"]
    assert axes.get_xlabel() == "ours over printed"
    assert [text.get_text() for text in figure.legends[0].get_texts()][:2] == ["PD", "AFSM"]


def by_condition():
    low = np.array([[10.0, 20.0], [30.0, 40.0], [50.0, 60.0]])  # of each of two conditions and two hinges
    spread = 1e-3 * np.stack([low[:2] * factor for factor in (0.5, 1.0, 3.0)])
    series = {
        "PD": conditions.ErrorsByCondition("pd", np.array([1.0, 2.0]), spread, np.array([True, False]), {}),
        "AFSM": conditions.ErrorsByCondition(
            "afsm", np.array([1.0, 2.0]), spread / 10, np.array([True, True]), {2.0: (0.008, 0.009)}
        ),
    }
    return conditions.by_condition(series, ("α", "β"), "load L", "largest |error|", "title")


def test_errors_by_condition_have_medians_ranges_and_the_printed_number_of_their_hinge():
    left, right = by_condition().axes[:2]
    for hinge, panel in enumerate((left, right)):
        lines = {line.get_label(): line for line in panel.get_lines() if len(line.get_xdata())}
        np.testing.assert_allclose(lines["PD"].get_ydata(), [[10.0, 30.0], [20.0, 40.0]][hinge])
        np.testing.assert_allclose(lines["AFSM"].get_ydata(), [[1.0, 3.0], [2.0, 4.0]][hinge])
        # A law is shifted to the left of its condition, the other to the right.
        np.testing.assert_allclose(lines["PD"].get_xdata() + lines["AFSM"].get_xdata(), [2.0, 4.0])
        assert lines["PD"].get_xdata()[0] < 1.0
        bars = panel.collections[0].get_segments()
        np.testing.assert_allclose(
            [bar[:, 1] for bar in bars], [[[5.0, 30.0], [15.0, 90.0]], [[10.0, 60.0], [20.0, 120.0]]][hinge]
        )
        (dotted,) = (
            line
            for line in panel.get_lines()
            if line.get_linestyle() == ":" and len(line.get_xdata()) == 2 and np.ptp(line.get_xdata()) == 0
        )
        np.testing.assert_allclose(dotted.get_ydata(), [[8.0, 3.0], [9.0, 4.0]][hinge])
        assert list(panel.get_xticks()) == [1.0, 2.0]
        assert (panel.get_xlabel(), panel.get_title()) == ("load L", "αβ"[hinge])


def test_errors_by_condition_have_names_and_room_for_all_values():
    figure = by_condition()
    left = figure.axes[0]
    assert left.get_ylabel() == "largest |error|, mrad"
    assert figure.get_suptitle() == "title"
    low, high = left.get_ylim()
    assert 0.25 < low < 0.5
    assert 120.0 < high < 240.0
    handles = {
        text.get_text(): line
        for text, line in zip(figure.legends[0].get_texts(), figure.legends[0].get_lines(), strict=True)
    }
    assert list(handles) == ["PD", "AFSM", "printed", "ended early"]
    assert [handles[label].get_color() for label in ("PD", "AFSM")] == [law_colour("pd"), law_colour("afsm")]
    assert handles["ended early"].get_markerfacecolor() == "white"


def test_ratios_are_on_a_logarithmic_axis_around_the_paper():
    rows = [conditions.RatioRow(name, {"pd": np.array([0.5, 3.0, 2.0])}) for name in ("one", "another")]
    axes = conditions.ratios(rows, {"pd": "PD"}, "ours over printed", "title").axes[0]
    spans = [line for line in axes.get_lines() if line.get_marker() == "None" and len(line.get_xdata()) == 2]
    paper = [line for line in spans if line.get_label() == "the paper"]
    assert [list(line.get_xdata()) for line in paper] == [[1.0, 1.0]]
    of_law = [list(line.get_xdata()) for line in spans if line.get_color() == law_colour("pd")]
    assert of_law == [[0.5, 3.0]] * 2
    assert axes.get_xscale() == "log"
    assert axes.get_ylim() == (1.5, -0.5)
    assert axes.get_title() == "title"


def test_estimators_have_measured_dots_and_derived_lines_in_their_units(figure):
    above, below = figure.axes
    for axes, factor, measured, derived in (
        (above, 1.0, "rms_error_rad_s", "derived_rms_error_rad_s"),
        (below, 1e3, "lag_s", "derived_lag_s"),
    ):
        curve = CURVES["slow"]
        of_slow = [line for line in axes.get_lines() if line.get_color() == conditions.SERIES[0]]
        dots, line, default = of_slow
        assert (dots.get_linestyle(), default.get_linestyle()) == ("None", "--")
        np.testing.assert_allclose(dots.get_ydata(), factor * getattr(curve, measured))
        np.testing.assert_allclose(line.get_ydata(), factor * getattr(curve, derived))
        np.testing.assert_allclose(line.get_xdata(), BANDWIDTHS)
        assert [text.get_text() for text in axes.get_legend().get_texts()][:2] == ["slow", "exact"]
    assert above.get_title().startswith("rates")
