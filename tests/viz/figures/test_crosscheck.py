"""Figures of the cross-check: values, bounds, rows and units."""

import numpy as np
import pytest

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.viz.figures import crosscheck, style

T = np.linspace(0.0, 1.0, 5)
THREE = np.stack([np.sin(T), np.cos(T), T], axis=1)


def labelled(axes):
    return {line.get_label(): line for line in axes.get_lines()}


def test_margins_are_shares_of_their_bounds_in_rows_from_the_top():
    axes = crosscheck.margins({"one": 0.5, "two": 2.0, "three": 1e-3}, "title").axes[0]
    lines = labelled(axes)
    assert (list(lines["within the bound"].get_xdata()), list(lines["within the bound"].get_ydata())) == (
        [0.5, 1e-3],
        [0, 2],
    )
    assert (list(lines["exceeds the bound"].get_xdata()), list(lines["exceeds the bound"].get_ydata())) == (
        [2.0],
        [1],
    )
    assert set(lines["bound"].get_xdata()) == {1.0}
    assert [text.get_text() for text in axes.get_yticklabels()] == ["one", "two", "three"]
    assert axes.get_ylim()[0] > axes.get_ylim()[1]
    assert axes.get_xlabel() == "value over bound"


def test_spreads_have_quantiles_median_worst_and_bound():
    values = np.linspace(1e-15, 1e-13, 101)
    axes = crosscheck.spreads({"MuJoCo": {"M": values}}, {"M": 1e-12}, "title").axes[0]
    span, median, worst, bound = axes.get_lines()
    np.testing.assert_allclose(span.get_xdata(), np.quantile(values, [0.01, 0.99]))
    assert list(median.get_xdata()) == pytest.approx([np.median(values)])
    assert list(worst.get_xdata()) == [values.max()]
    assert list(bound.get_xdata()) == [1e-12, 1e-12]
    assert [line.get_label() for line in axes.get_lines()] == [
        "MuJoCo: 1 to 99 %",
        "median",
        "worst",
        "bound",
    ]


def test_spreads_stand_in_the_rows_of_their_quantities():
    differences = {
        source: {"M": factor * np.array([1e-9, 3e-9]), "tau": factor * np.array([1e-5, 2e-5])}
        for source, factor in (("MuJoCo", 1.0), ("Pinocchio", 10.0))
    }
    axes = crosscheck.spreads(differences, {"M": 1e-7, "tau": 1e-3}, "title").axes[0]
    labels = [text.get_text() for text in axes.get_yticklabels()]
    assert labels == ["M", "tau"]
    worst = [line for line in axes.get_lines() if line.get_marker() == "o"]
    bounds = [line for line in axes.get_lines() if line.get_linestyle() == "--"]
    for line, source in zip(worst, ("MuJoCo", "MuJoCo", "Pinocchio", "Pinocchio"), strict=True):
        quantity = labels[round(line.get_ydata()[0])]
        assert line.get_xdata()[0] == differences[source][quantity].max()
        assert line.get_color() == style.SERIES[source == "Pinocchio"]
    assert [(line.get_xdata()[0], round(np.mean(line.get_ydata()))) for line in bounds] == [
        (1e-7, 0),
        (1e-3, 1),
    ]


def test_motion_has_tilts_spin_and_differences():
    tilt, spin, apart = crosscheck.motion(T, THREE, -1e-9 * THREE, 1e-8, "title").axes
    for axes, axis, factor in ((tilt, 0, 1), (tilt, 1, 1), (spin, 2, 1), (apart, 0, 1e-9), (apart, 2, 1e-9)):
        line = labelled(axes)[ANGLES[axis]]
        expected = factor * np.abs(THREE[:, axis])
        if axes is apart:
            expected[expected == 0] = np.nan
        np.testing.assert_allclose(line.get_ydata(), expected)
        np.testing.assert_array_equal(line.get_xdata(), T)
        assert line.get_color() == style.AXES[axis]
    assert set(labelled(apart)["bound 1.0e-08 rad"].get_ydata()) == {1e-8}
    assert [axes.get_ylabel() for axes in (tilt, spin, apart)] == [
        "tilt, rad",
        "spin, rad",
        "|difference|, rad",
    ]


def test_convergence_is_over_milliseconds_with_the_order():
    steps = np.array([1e-3, 2e-3, 4e-3])
    axes = crosscheck.convergence({"RK4": crosscheck.Slope(steps, 3e7 * steps**4, 4.0)}, "title").axes[0]
    dots, fit = axes.get_lines()
    assert dots.get_label() == "RK4: order 4.00"
    np.testing.assert_allclose(dots.get_xdata(), [1.0, 2.0, 4.0])
    np.testing.assert_allclose(dots.get_ydata(), 3e7 * steps**4)
    np.testing.assert_allclose(fit.get_xdata(), [1.0, 4.0])
    np.testing.assert_allclose(fit.get_ydata(), 3e7 * steps[[0, -1]] ** 4)
    assert (axes.get_xlabel(), axes.get_xscale(), axes.get_yscale()) == ("step, ms", "log", "log")


def test_drifts_are_sizes_with_their_bounds():
    bounded = crosscheck.Bounded(np.array([0.0, -1e-9, 1e-9, 2e-9, -3e-9]), 1e-8)
    axes = crosscheck.drifts(T, {"energy, relative": {"30": bounded}}, "title").axes[0]
    lines = labelled(axes)
    np.testing.assert_allclose(lines["30"].get_ydata(), [np.nan, 1e-9, 1e-9, 2e-9, 3e-9])
    assert set(lines["bound 1.0e-08"].get_ydata()) == {1e-8}
    assert (axes.get_ylabel(), axes.get_xlabel(), axes.get_yscale()) == ("energy, relative", "time, s", "log")


def test_closed_loops_compare_the_errors_of_both_plants():
    other = 2 * THREE[:3]
    figure = crosscheck.closed_loops(
        T, {"PD": (THREE, other)}, {"PD": crosscheck.Bounded(1e-9 * T[:3], 1e-8)}, ("one", "other"), "title"
    )
    top, bottom = figure.axes
    lines = top.get_lines()
    for axis in range(3):
        np.testing.assert_array_equal(lines[2 * axis].get_ydata(), THREE[:, axis])
        np.testing.assert_array_equal(lines[2 * axis + 1].get_ydata(), other[:, axis])
        assert lines[2 * axis].get_label() == f"{ANGLES[axis]}, one"
    assert lines[5].get_label() == "other"
    np.testing.assert_allclose(labelled(bottom)["worst hinge"].get_ydata(), [np.nan, *(1e-9 * T[1:3])])
    assert (top.get_ylabel(), bottom.get_ylabel()) == ("tracking error, rad", "|difference|, rad")
