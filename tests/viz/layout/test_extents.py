"""Ranges and titles from the extents of a run."""

import numpy as np
import pytest

from spheretwin.models.telemetry.signals import Signal, common_signals
from spheretwin.viz.layout.extents import CLIPPED_FROM, Extents, PlotChannel, plotted_signals

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
    ("values", "low", "high", "is_cut"),
    [
        (values_of(0.5, 31.0, 0, 4), 0.5, 1.0, True),  # settled after a transient
        (values_of(0.5, 0.45 * CLIPPED_FROM, 0, 4), 0.45 * CLIPPED_FROM, np.inf, False),
        (values_of(0.1, 10.0, 0, 30), 10.0, np.inf, False),  # too long for a transient
        (values_of(0.1, 40.0, 80, 82), 40.0, np.inf, False),  # in the second half
        (values_of(0.1, 40.0, 80, 81), 0.1, 1.0, True),  # a spike there
        (values_of(1e-6, 1e-6, 0, 0), 0.1 - 1e-12, np.inf, False),  # noise looks small
    ],
)
def test_a_settled_error_is_legible_and_only_a_short_large_transient_is_outside(values, low, high, is_cut):
    of = seen(values)
    limit = of.limit(ERROR, least=0.1)
    assert low < limit <= high
    assert of.is_cut(limit, ERROR) == is_cut


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


def test_what_a_run_did_not_have_all_the_time_bounds_nothing():
    values = np.full(len(T_s), np.nan)
    values[:50] = 3.0
    assert seen(values).limit(ERROR, least=0.1) == 4.0
    assert seen(values * np.nan).limit(ERROR, least=0.1) >= 0.1
    assert seen(values).band(ERROR, least=0.1) == pytest.approx((-3.3, 3.3))
    assert seen(values * 0.0 + 1e-6).band(ERROR, least=0.1) == pytest.approx((-0.1, 0.1))


def test_a_signal_of_a_law_has_bounds_whatever_its_name():
    """A signal of the groups with the same name has a fixed range."""
    own, of_groups = Signal("coil_power_W", "W", 2, "own"), Signal("copper_loss_W", "W", 18, "loss")
    assert plotted_signals((*common_signals(18), own, of_groups)).keys() >= {"coil_power_W"}
    assert not plotted_signals((*common_signals(18), own, of_groups)).keys() & {"copper_loss_W", "error_rad"}
