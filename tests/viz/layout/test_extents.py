"""Ranges and titles from the extents of a run."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.viz.layout.extents import CLIPPED_FROM, LABELLED, MARGIN, Extents, PlotChannel, labelled, nice

T_s = np.arange(100) * 0.1
ERROR = PlotChannel("error")


def seen(values, ended_s=None):
    """A run whose only channel is within ± these values."""
    high = np.asarray(values, dtype=np.float64).reshape(len(T_s), -1)
    return Extents(T_s, {"error": -high}, {"error": high}, ended_s)


def values_of(rest, others, first, last):
    """A value at all times but some."""
    place = np.arange(len(T_s))
    return np.where((place >= first) & (place < last), others, rest)


@pytest.mark.parametrize(
    ("values", "low", "high", "text"),
    [
        (values_of(0.5, 31.0, 0, 4), 0.5, 1.0, ", largest 31 in first 0.4 s"),  # settled after a transient
        (values_of(0.5, 0.45 * CLIPPED_FROM, 0, 4), 0.45 * CLIPPED_FROM, np.inf, ", largest 1.12"),
        (values_of(0.1, 10.0, 0, 30), 10.0, np.inf, None),  # too long for a transient
        (values_of(0.1, 40.0, 80, 81), 40.0, np.inf, None),  # in the second half
        (values_of(1e-6, 1e-6, 0, 0), 0.1 - 1e-12, np.inf, None),  # noise looks small
    ],
)
def test_a_settled_error_is_legible_and_only_a_short_large_transient_is_outside(values, low, high, text):
    of = seen(values)
    limit = of.limit(ERROR, least=0.1)
    assert low < limit <= high
    assert text is None or of.largest(limit, ERROR) == text


@pytest.mark.parametrize(
    ("corner", "late", "sign"),
    [
        ("RightTop", True, 1.0),
        ("LeftTop", False, 1.0),
        ("RightBottom", True, -1.0),
        ("LeftBottom", False, -1.0),
    ],
)
def test_a_legend_stands_where_the_lines_are_not(corner, late, sign):
    """Lines reach into all quarters of the plot but one."""
    empty = (T_s > T_s[-1] / 2) == late
    far = np.full(len(T_s), 0.8)
    towards, away = np.where(empty, 0.0, far), far
    high, low = (towards, -away) if sign > 0 else (away, -towards)
    of = Extents(T_s, {"error": low[:, None]}, {"error": high[:, None]}, None)
    assert of.emptiest_corner((-1.0, 1.0), ERROR) == corner


def test_plots_that_are_compared_have_one_range():
    of = seen(np.stack([np.full(len(T_s), 1.0), np.full(len(T_s), 9.0)], axis=1))
    assert of.limit(ERROR, least=0.1) > 9.0
    assert of.limit(PlotChannel("error", 0), least=0.1) < 2.0


def test_what_a_run_did_not_have_all_the_time_bounds_nothing():
    values = np.full(len(T_s), np.nan)
    values[:50] = 3.0
    assert seen(values).limit(ERROR, least=0.1) == 4.0
    assert seen(values * np.nan).limit(ERROR, least=0.1) >= 0.1
    assert seen(values).band(ERROR, least=0.1) == pytest.approx((-3.3, 3.3))
    assert seen(values * 0.0 + 1e-6).band(ERROR, least=0.1) == pytest.approx((-0.1, 0.1))


@given(st.floats(1e-9, 1e9))
def test_a_nice_number_is_just_above(value):
    # The next number of a decade is at most 5/2 as large; a value within 1e-9 of one is that one.
    assert value * (1 - 2e-9) <= nice(value) <= 5 / 2 * value * (1 + 1e-9)
    assert float(f"{nice(value):.1e}") == pytest.approx(nice(value), rel=1e-12)


def ticks(low, high):
    """What a viewer labels: multiples of the least power of ten of which few enough are in the range."""
    step = 1e-12
    while (high - low) / step > 1.2 * LABELLED:  # what is extended has a little more
        step *= 10
    return np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1) * step


@given(st.floats(-1e3, 1e3), st.floats(0, 1e3), st.floats(1e-3, 10))
def test_a_range_around_anything_has_two_labels(low, width, least):
    first, last = labelled(low, low + width, least)
    reach = max(least, MARGIN * width / 2)
    # Sums of numbers up to 1e3.
    assert first <= low + width / 2 - reach + 1e-9
    assert last >= low + width / 2 + reach - 1e-9
    result = ticks(first, last)
    assert len(result) >= 2
    # A step is up to ten times the eighth part of the range, and one or two are added with their room.
    assert last - first <= (2 * 10 / LABELLED + 1.2) * 2 * reach * 1.1


@given(st.floats(1e-6, 1e6))
def test_a_range_about_zero_has_a_label_beside_zero(value):
    assert len(ticks(-nice(value), nice(value))) >= 3
