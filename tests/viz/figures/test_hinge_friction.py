"""The friction's figure: one colour a way, what is slower than the axis shows at its edge, units."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread

from spheretwin.viz.figures import crosscheck, style

UP = np.linspace(0, 3e-3, 200)
TORQUE = np.concatenate([UP, UP[-2::-1]])
IDEAL = np.concatenate([np.maximum(UP - 2e-3, 0), np.maximum(UP[-2::-1] - 1e-3, 0)]) * 500
T = np.linspace(0, 3, 3001)
COAST = np.maximum(2 - T, 0)


def bearing(level):
    rates = {"ours": IDEAL + 5 * TORQUE, "theirs": IDEAL + 0.5 * TORQUE}
    ramped = crosscheck.Ramped(TORQUE, rates, IDEAL, level, level / 2, {"ours": 5e-3, "theirs": 5e-4})
    late = {"ours": COAST + 1e-3, "theirs": COAST + np.where(T > 1.9, 1e-3, 0)}
    return ramped, crosscheck.Resting(T, late, COAST, 2.0)


def drawn() -> Figure:
    return crosscheck.hinge_friction({"soft": bearing(2e-3), "hard": bearing(2.5e-3)}, "friction")


@pytest.fixture
def figure() -> Figure:
    return drawn()


def test_same_bearings_give_the_same_bytes(tmp_path):
    paths = [tmp_path / "a.png", tmp_path / "b.png"]
    for path in paths:
        style.save(drawn(), path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    pixels = imread(paths[0])
    assert pixels.shape[1] == style.WIDTH_in * style.DPI
    inked = np.any(pixels[:, :, :3] < 0.9, axis=2)
    assert 0.003 < inked.mean() < 0.6


def test_every_axis_has_its_unit_and_every_column_its_bearing(figure):
    ramps, coasts, stops = (figure.axes[row : row + 2] for row in (0, 2, 4))
    assert [axes.get_xlabel() for axes in (ramps[0], coasts[0], stops[0])] == [
        "torque, mN·m", "time, s", "time after the ideal stop, ms",
    ]  # fmt: skip
    assert [axes.get_ylabel() for axes in (ramps[0], coasts[0], stops[0])] == [
        "rate, rad/s", "rate less ideal, mrad/s", "rate, rad/s",
    ]  # fmt: skip
    assert [axes.get_title().splitlines()[0] for axes in ramps] == ["soft", "hard"]
    assert {axes.get_yscale() for axes in (*ramps, *stops)} == {"log"}
    assert coasts[0].get_title() == "coasting from 2 rad/s"


def test_each_way_has_one_colour_and_is_named_once(figure):
    (legend,) = figure.legends
    names = [text.get_text() for text in legend.get_texts()]
    assert names == ["ours", "theirs", "ideal friction", "Coulomb level", "settled at half the level"]
    for axes in figure.axes:
        colours = [line.get_color() for line in axes.get_lines()]
        assert {style.SERIES[0], style.SERIES[1], style.INK} <= set(colours)


def test_torque_is_in_mNm_with_the_level_and_the_creep_where_they_are(figure):
    lines = {line.get_label(): line for line in figure.axes[1].get_lines()}
    np.testing.assert_allclose(lines["ours"].get_xdata(), 1e3 * TORQUE, rtol=1e-15)
    np.testing.assert_allclose(lines["Coulomb level"].get_xdata(), 2.5, rtol=1e-15)
    dots = [line.get_xydata()[0] for line in figure.axes[1].get_lines() if line.get_marker() == "o"
            and len(line.get_xdata())]  # fmt: skip
    np.testing.assert_allclose(dots, [[1.25, 5e-3], [1.25, 5e-4]], rtol=1e-15)


def test_rest_lies_below_what_the_axis_shows(figure):
    ideal = next(line for line in figure.axes[0].get_lines() if line.get_label() == "ideal friction")
    assert min(ideal.get_ydata()) == 0.1 * crosscheck.SLOWEST_rad_s
    assert figure.axes[0].get_ylim()[0] == crosscheck.SLOWEST_rad_s


def test_coasting_is_drawn_beside_ideal_and_its_end_about_the_ideal_stop(figure):
    ours = figure.axes[2].get_lines()[0].get_xydata()
    np.testing.assert_allclose(ours[:, 1], 1.0, rtol=1e-9)  # mrad/s; a difference of rates near 2
    end = figure.axes[4].get_lines()[0].get_xydata()
    np.testing.assert_allclose(end[[0, -1], 0], [-60, 60], atol=1.001)  # a row a millisecond
    after = end[end[:, 0] > 1e-6, 1]
    np.testing.assert_allclose(after, 1e-3, rtol=1e-12)


def test_arrows_say_where_the_ramp_goes(figure):
    up, back = figure.axes[0].texts
    assert up.xy[0] > up.xyann[0]
    assert up.xy[1] > up.xyann[1]
    assert back.xy[0] < back.xyann[0]
