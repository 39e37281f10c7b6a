"""Figure of the estimators: measured and derived values, hidden lags, names."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from spheretwin.viz.figures import conditions

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
        conditions.save(drawn(), path)
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
