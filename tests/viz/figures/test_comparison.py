"""Figures of several runs: data of constructed signals, ranges, marks, labels and scales."""

import numpy as np
import pytest
from matplotlib.colors import to_hex, to_rgba

from spheretwin.models.telemetry.status import Level
from spheretwin.viz import theme
from spheretwin.viz.comparison.runs import Spectrum
from spheretwin.viz.figures import comparison, style
from tests.viz.comparison.compared import RAMP, SIGNALS, VALUE, PERIOD_s, T_s, run_of

ANGLE = VALUE._replace(title="error as one angle", unit="°", group="whole")


def named_lines(panel):
    return {line.get_label(): line for line in panel.get_lines()}


@pytest.mark.parametrize("name", SIGNALS)
def test_a_long_run_is_drawn_as_bounds_and_mean_of_every_bin(name):
    values = SIGNALS[name]
    panel = comparison.over_time([run_of(values)], [], [VALUE], "title").axes[0]
    size = len(values) // style.MOST_BINS  # 4 ticks
    blocks = values.reshape(-1, size)
    (band,) = panel.collections
    x, y = band.get_paths()[0].vertices.T
    for place in (0, 1, len(blocks) // 2, 2345 // size, len(blocks) - 1):
        start, end = T_s[place * size], T_s[min((place + 1) * size, len(values) - 1)]
        inside = np.isclose(x, start, atol=1e-9) | np.isclose(x, end, atol=1e-9)
        for bound in (blocks[place].min(), blocks[place].max()):
            assert np.isclose(y[inside], bound, atol=1e-12).sum() >= 2  # both ends of the step
    assert (x.min(), x.max()) == (T_s[0], T_s[-1])
    assert (y.min(), y.max()) == (values.min(), values.max())
    (line,) = panel.get_lines()
    np.testing.assert_allclose(line.get_ydata()[1:-1], blocks.mean(axis=1), atol=1e-12)
    np.testing.assert_allclose(line.get_xdata()[1:-2], T_s.reshape(-1, size)[:-1].mean(axis=1) + PERIOD_s / 2)
    assert (line.get_xdata()[0], line.get_ydata()[0]) == (T_s[0], values[0])
    assert (line.get_xdata()[-1], line.get_ydata()[-1]) == (T_s[-1], values[-1])
    assert to_rgba(line.get_color())[:3] == tuple(band.get_facecolor()[0][:3])


def test_a_short_run_is_drawn_at_its_logged_rate():
    run = run_of(SIGNALS["square"][:900], start_s=2.0)
    panel = comparison.over_time([run], [], [VALUE], "title").axes[0]
    assert len(panel.collections) == 0
    (line,) = panel.get_lines()
    assert np.array_equal(line.get_xdata(), run.table["t_s"])
    assert np.array_equal(line.get_ydata(), SIGNALS["square"][:900])


def test_a_chattering_signal_has_no_line_between_its_extremes():
    """The mean of a 250 Hz square wave of whole periods is constant."""
    (line,) = comparison.over_time([run_of(SIGNALS["square"])], [], [VALUE], "title").axes[0].get_lines()
    np.testing.assert_allclose(line.get_ydata()[1:-1], 0.5, atol=1e-12)


def compared():
    settled = 0.01 * np.sin(40 * T_s) + np.where(T_s < 0.3, 2.0, 0.0)
    failed = np.where(T_s < 1.9, 0.005, 30.0)[:2000]
    return [
        run_of(settled, "1 first: afsm", "afsm"),
        run_of(failed, "2 other: pd", "pd", status="left workspace"),
    ]


def test_a_failed_run_is_marked_with_time_and_reason_and_the_range_is_that_of_the_other():
    figure = comparison.over_time(compared(), [0], [VALUE], "Angles: scenario tilt, L 2")
    panel = figure.axes[0]
    assert panel.get_ylim()[1] < 0.02
    assert "run 1 reaches 2" in panel.get_title(loc="right")
    assert "run 2 reaches 30 (1.9 s to 2 s)" in panel.get_title(loc="right")
    (mark,) = [line for line in panel.get_lines() if line.get_marker() == "X"]
    assert mark.get_xdata() == [pytest.approx(1.999)]
    assert list(mark.get_ydata()) == [panel.get_ylim()[1]]  # at the edge of the range
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "1 first: afsm",
        "2 other: pd; left workspace at 2 s",
    ]
    assert figure.get_suptitle() == "Angles: scenario tilt, L 2"


def test_runs_have_the_colours_of_their_laws_and_distinct_dashes():
    figure = comparison.over_time(compared(), [], [VALUE], "title")
    lines = list(named_lines(figure.axes[0]).values())[:2]
    assert [line.get_color() for line in lines] == [theme.law_colour("afsm"), theme.law_colour("pd")]
    handles = figure.legends[0].get_lines()
    assert [handle.get_color() for handle in handles] == [theme.law_colour("afsm"), theme.law_colour("pd")]
    eight = [run_of(T_s[:10], f"{i} run") for i in range(8)]
    looks = style.run_styles(eight)
    assert len({str(look.dash) for look in looks}) == len({look.colour for look in looks}) == 8


def test_the_legend_is_below_the_panels():
    eight = [run_of(RAMP, f"{i} run: pd, L {i}") for i in range(1, 9)]
    figure = comparison.over_time(eight, [], [VALUE], "title")
    figure.draw_without_rendering()
    (legend,) = figure.legends
    assert len(legend.get_texts()) == 8
    lowest = min(axes.get_tightbbox().y0 for axes in figure.axes)
    assert legend.get_window_extent().y1 <= lowest
    assert legend.get_window_extent().y0 >= 0


def test_the_error_angle_has_a_logarithmic_axis_too_with_every_value():
    runs = compared()
    linear, logarithmic = comparison.over_time(runs, [], [ANGLE], "title").axes
    assert (linear.get_yscale(), logarithmic.get_yscale()) == ("linear", "log")
    assert linear.get_ylabel() == "error as one angle,\n°"
    assert logarithmic.get_ylabel() == "error as one angle,\n°, logarithmic"
    assert logarithmic.get_ylim()[1] > 30.0
    assert linear.get_ylim()[1] < 0.02
    mark = [line for line in logarithmic.get_lines() if line.get_marker() == "X"]
    assert list(mark[0].get_ydata()) == [30.0]
    assert logarithmic.get_xlabel() == "time, s"


def test_a_logarithmic_axis_has_six_decades_at_most_and_says_so():
    decay = 10.0 ** (-4.0 * T_s)  # to 1e-16
    panel = comparison.over_time([run_of(decay)], [], [ANGLE], "title").axes[1]
    low, high = panel.get_ylim()
    assert high == pytest.approx(1.5)
    assert low == pytest.approx(1.5e-6)
    assert panel.get_title(loc="right") == "values below 2e-06 are below the axis"
    few = comparison.over_time([run_of(decay[:900])], [], [ANGLE], "title").axes[1]
    assert few.get_ylim()[0] == pytest.approx(decay[899] / 1.5)
    assert few.get_title(loc="right") == ""


def test_the_reference_is_a_thin_dark_line_of_the_leading_run():
    quantity = VALUE._replace(desired=lambda rows: rows.table["q_rad"][:, 0] + 1.0)
    runs = [run_of(RAMP[:500], "1 a"), run_of(RAMP[:900], "2 b")]
    lines = named_lines(comparison.over_time(runs, [1], [quantity], "title").axes[0])
    assert list(lines) == ["1 a", "2 b", "reference"]
    assert np.array_equal(lines["reference"].get_ydata(), RAMP[:900] + 1.0)
    assert lines["reference"].get_color() == style.INK
    both = named_lines(comparison.over_time(runs, [0, 1], [quantity], "title").axes[0])
    assert list(both)[2:] == ["reference of 1 a", "reference of 2 b"]


def test_a_quantity_with_limits_has_them():
    panel = comparison.over_time([run_of(RAMP)], [], [VALUE._replace(limits=(-7.0, 9.0))], "t").axes[0]
    assert panel.get_ylim() == (-7.0, 9.0)
    assert panel.get_title(loc="right") == ""


def with_currents():
    run = run_of(RAMP)
    rows = np.arange(len(T_s))
    run.table["current_A"][:] = np.linspace(-2.0, 2.0, 18)
    run.table["current_A"][:, 5] = np.where(rows // 2 % 2, 3.0, -3.0)  # mean 0, deviation 3
    return run


def test_currents_are_means_of_cells_with_a_lane_of_their_variation():
    run = with_currents()
    figure = comparison.currents([run], "Currents: scenario tilt")
    panel, lane = figure.axes[:2]
    (means,), (variation,) = panel.collections, lane.collections
    size = len(T_s) // comparison.MOST_CELLS
    cells = run.table["current_A"].reshape(-1, size, 18)
    np.testing.assert_allclose(means.get_array(), cells.mean(axis=1).T, atol=1e-12)
    np.testing.assert_allclose(variation.get_array()[0], 3.0, atol=1e-12)
    # Group 0 is at the top.
    assert panel.get_ylim() == (17.5, -0.5)
    edges = means.get_coordinates()
    assert list(edges[:, 0, 1]) == [group - 0.5 for group in range(19)]
    np.testing.assert_allclose(edges[0, :-1, 0], T_s[::size])
    assert edges[0, -1, 0] == pytest.approx(T_s[-1] + PERIOD_s)
    assert means.get_clim() == (-3.0, 3.0)
    negative, zero, positive = means.get_cmap()([0.0, 0.5, 1.0])
    assert negative[2] > negative[0] + 0.25
    assert positive[0] > positive[2] + 0.25
    assert np.ptp(zero[:3]) < 0.02
    bars = [axes.get_ylabel() for axes in figure.axes[2:]]
    assert bars == ["mean current of a cell, A", "standard deviation within a cell, A"]
    assert panel.get_title(loc="left") == "1 made: pd"
    assert (panel.get_ylabel(), lane.get_xlabel()) == ("group", "time, s")


def test_events_are_at_their_times_with_the_mark_of_their_level():
    events = [(1.0, Level.WARN, "a warning"), (2.0, Level.ERROR, "an error"), (0.5, Level.INFO, "a note")]
    runs = [run_of(RAMP, "1 a"), run_of(RAMP[:3000], "2 b", events=events)]
    figure = comparison.events_figure(runs, "Events: scenario tilt")
    axes = figure.axes[0]
    marks = {
        line.get_marker(): (list(line.get_xdata()), set(line.get_ydata()))
        for line in axes.get_lines()
        if line.get_marker() != "None" and len(line.get_xdata())
    }
    assert marks == {"^": ([1.0], {1}), "X": ([2.0], {1}), "|": ([0.5], {1})}
    spans = [line for line in axes.get_lines() if line.get_marker() == "None"]
    assert [list(line.get_xdata()) for line in spans] == [[0.0, T_s[-1]], [0.0, T_s[2999]]]
    legend = {
        text.get_text(): handle.get_marker()
        for text, handle in zip(figure.legends[0].get_texts(), figure.legends[0].get_lines(), strict=True)
    }
    assert legend == {"info": "|", "warn": "^", "error": "X"}
    assert [label.get_text() for label in axes.get_yticklabels()] == ["1 a", "2 b"]
    assert axes.get_ylim() == (1.5, -0.5)  # the first run is at the top
    assert axes.get_xlabel() == "time, s"


def test_spectra_are_drawn_by_hinge_with_their_peaks_on_logarithmic_axes():
    frequency = np.array([1.0, 2.0, 4.0, 8.0])
    amplitudes = [np.array([1.0, 2.0, 3.0, 4.0]) * (place + 1) for place in range(3)]
    spectra = [[Spectrum(frequency, values, [(4.0, values[2])]) for values in amplitudes]]
    figure = comparison.spectra([run_of(RAMP)], spectra, "title")
    assert [axes.get_ylabel() for axes in figure.axes] == [
        f"error of {name},\namplitude, mrad" for name in "αβγ"
    ]
    for axes, values in zip(figure.axes, amplitudes, strict=True):
        line, peak = axes.get_lines()
        assert np.array_equal(line.get_xdata(), frequency)
        assert np.array_equal(line.get_ydata(), values)
        assert (list(peak.get_xdata()), list(peak.get_ydata())) == ([4.0], [values[2]])
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert figure.axes[-1].get_xlabel() == "frequency, Hz"
    assert to_hex(figure.axes[0].get_lines()[0].get_color()) == theme.law_colour("pd")
