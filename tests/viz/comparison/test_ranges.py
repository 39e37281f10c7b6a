"""Ranges of plots of several runs: settled runs are legible, and values outside are stated."""

import numpy as np
import pytest

from spheretwin.viz.comparison.runs import quantity_range, settled_range
from tests.viz.comparison.compared import VALUE, T_s, run_of


def range_of(*runs):
    return settled_range(runs, [run.table["q_rad"][:, 0] for run in runs], 1e-3)


def test_values_of_similar_size_are_all_within_the_range():
    values = 1.0 + np.sin(7 * T_s)
    low, high, outside = range_of(run_of(values))
    assert outside == ()
    # A margin of a tenth of the span about its middle.
    assert (low, high) == pytest.approx(
        (values.min() - 0.05 * np.ptp(values), values.max() + 0.05 * np.ptp(values))
    )


def test_a_transient_is_outside_and_stated():
    settled, transient = 0.01 * np.sin(40 * T_s), np.where(T_s < 0.3, 2.0 - T_s, 0.0)
    low, high, outside = range_of(run_of(0 * T_s), run_of(settled + transient))
    assert -0.012 < low < -0.01 < 0.01 < high < 0.012
    (item,) = outside
    assert (item.run, item.from_s) == (2, 0.0)
    assert item.value == pytest.approx(2.0, abs=0.02)
    assert item.until_s == pytest.approx(0.299)
    assert item.text() == "run 2 reaches 2 (0 s to 0.299 s)"


def test_a_failed_run_does_not_flatten_the_others_and_alone_it_is_shown_without_its_end():
    diverged = -np.exp(np.minimum(8 * T_s[:2000], 12.0))
    low, high, outside = range_of(run_of(0.1 * np.sin(9 * T_s)), run_of(diverged, status="diverged"))
    assert (low, high) == pytest.approx((-0.11, 0.11), rel=1e-3)
    assert [(item.run, item.value) for item in outside] == [(2, diverged.min())]
    low, high, outside = range_of(run_of(np.where(T_s < 3.9, np.sin(9 * T_s), -1e6), status="diverged"))
    assert -1.2 < low < -0.9 < 0.9 < high < 1.2
    assert outside[0].value == -1e6


def test_values_without_a_number_are_ignored_and_a_run_without_any_or_of_zeros_has_a_range():
    assert range_of(run_of(np.where(T_s > 3.99, np.nan, np.sin(9 * T_s)))).outside == ()
    for values in ([np.nan, np.inf], [0.0, 0.0]):
        assert range_of(run_of(np.array(values))) == (-1e-3, 1e-3, ())


def test_a_reference_is_within_the_range():
    """A ramp of the desired angle and a run that is settled at its end only."""
    desired = np.where(T_s < 1.0, T_s, 1.0)
    quantity = VALUE._replace(desired=lambda rows: desired)
    runs = [run_of(desired + 1e-3), run_of(np.where(T_s < 0.1, 50.0, 1.0))]
    low, high, outside = quantity_range(quantity, runs, [0])
    assert low < 0
    assert 1.001 < high < 1.2
    assert [item.run for item in outside] == [2]
