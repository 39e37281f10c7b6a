"""History of a bench: bins of 20 ms with the bounds of all rows, in any chunks; variation of the commands."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.bench.history import TEMPERATURE, History, LENGTH_s, RATE_Hz
from spheretwin.metrics.effort import CurrentVariation
from spheretwin.models.telemetry.signals import Signal
from tests.twin.bench.cases import GROUPS, table


def test_the_history_is_bounded_and_read_from_a_number_on():
    history, rows = History(GROUPS, 1e-3), table(0, 1000)
    seconds = round(LENGTH_s) + 5
    for second in range(seconds):
        history.write(1000 * second, rows)
    most = round(LENGTH_s * RATE_Hz)
    assert history.read().numbers == list(range(50 * seconds - most, 50 * seconds))
    assert history.read(50 * seconds - 3).numbers == [50 * seconds - 2, 50 * seconds - 1]
    assert history.read(50 * seconds).rows["q_rad"].shape == (0, 3)
    assert History(GROUPS, 1e-3).run != history.run


@given(st.sets(st.integers(1, 299)))
def test_bounds_are_those_of_all_rows_in_any_chunks(cuts):
    """A 250 Hz square wave, which rows at 50 Hz show as a constant, and a spike of one row."""
    rows, tick = table(0, 300), np.arange(300)
    rows["current_A"][:, 3] = np.where(tick // 2 % 2, 4.0, -4.0)
    rows["error_rad"][137, 1] = 0.2
    history = History(GROUPS, 1e-3)
    for first, last in zip([0, *sorted(cuts)], [*sorted(cuts), 300], strict=True):
        history.write(first, rows.rows(first, last))
    bins = history.read()
    for name in ("t_s", "current_A", "error_rad"):
        blocks = rows[name].reshape(15, 20, -1)
        np.testing.assert_array_equal(bins.low[name].reshape(15, -1), blocks.min(axis=1))
        np.testing.assert_array_equal(bins.high[name].reshape(15, -1), blocks.max(axis=1))
        np.testing.assert_array_equal(bins.rows[name].reshape(15, -1), blocks[:, 0])
    assert bins.high["current_A"][0, 3] - bins.low["current_A"][0, 3] == 8.0
    assert bins.high["error_rad"][137 // 20, 1] == 0.2


def test_temperatures_are_nan_where_a_run_has_none():
    history = History(GROUPS, 1e-3)
    history.write(0, table(0, 20))
    warm = table(0, 20, (Signal(TEMPERATURE, "°C", GROUPS, "at the end of the period"),))
    warm[TEMPERATURE][:] = 33.0
    history.write(20, warm)
    temperature = history.read().high[TEMPERATURE]
    assert np.isnan(temperature[0]).all()
    assert (temperature[1] == 33.0).all()


@pytest.mark.parametrize("chunk", [1, 33, 1000])
def test_chatter_is_the_variation_of_the_commands_in_the_last_second(chunk):
    """The metric `current_variation` divides by one period less: a run has one difference less than rows."""
    random = np.random.default_rng(3)
    rows = table(0, 1000)
    rows["current_command_A"][:] = random.normal(size=(1000, GROUPS)).cumsum(axis=0)
    history = History(GROUPS, 1e-3)
    for first in range(0, 1000, chunk):
        history.write(first, rows.rows(first, min(1000, first + chunk)))
    variation = np.abs(np.diff(rows["current_command_A"], axis=0)).sum(axis=0).mean()
    assert CurrentVariation.reads == ("current_command_A",)
    assert history.chatter_A_s == pytest.approx(variation, rel=1e-12)  # over 1 s; rounding
    history.write(1000, table(0, 1000))  # the second before is forgotten; one step back to zero remains
    assert history.chatter_A_s == pytest.approx(np.abs(rows["current_command_A"][-1]).mean(), rel=1e-12)
