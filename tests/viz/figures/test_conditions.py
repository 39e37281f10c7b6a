"""Figure of the estimators: measured and derived values, hidden lags, names."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from spheretwin.viz.figures import conditions, style

BANDWIDTHS = np.geomspace(20, 1000, 7)
CURVES = {
    "slow": conditions.Curve(
        BANDWIDTHS / 1e3, 1 / BANDWIDTHS, np.full(7, 1e-6), BANDWIDTHS / 1e3, 1 / BANDWIDTHS, 150.0
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


def test_same_curves_give_the_same_bytes(tmp_path):
    paths = [tmp_path / "a.png", tmp_path / "b.png"]
    for path in paths:
        style.save(drawn(), path)
    assert paths[0].read_bytes() == paths[1].read_bytes()


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
