"""Rows of a decimated recording: complete rows and all extremes, for any chunks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.signals import Signal, width
from spheretwin.models.telemetry.status import QUIET_S
from spheretwin.models.telemetry.table import Table
from spheretwin.records.outputs import check_rate
from spheretwin.viz.decimation import WINDOW_S, FirstAndExtremeRows, FirstRows
from tests.viz.tables import chunks

SIGNALS = (
    Signal("t_s", "s", 1, "time"),
    Signal("x_rad", "rad", 2, "a pair"),
    Signal("allocation_scale", "1", 1, "share"),
    Signal("fault", "1", 2, "states", ("a", "b"), ("fine", "open", "short")),
)
RATE_Hz = 60.0


def made(ticks, signals=SIGNALS, first=0):
    """Rows at 1 kHz: noise, some saturation that chatters, some changes of state."""
    generator = np.random.default_rng(first)
    table = Table(signals, generator.normal(size=(ticks, width(signals))))
    t_s = (first + np.arange(ticks)) * 1e-3
    table["t_s"][:] = t_s
    at_limit = np.sin(2 * np.pi * t_s / 3.1) > 0.9
    table["allocation_scale"][:] = np.where(at_limit & (generator.random(ticks) < 0.3), 0.7, 1.0)
    table["fault"][:] = np.floor(t_s[:, None] / [4.1, 7.3]) % 3
    return table


def thinned(thinning, tables):
    """Rows that are kept of tables that come one after the other."""
    rows = [each for table in tables for each in thinning.add(table)]
    return np.concatenate([each.values for each in [*rows, *thinning.flush()]])


def slowly(table):
    """The same rows, one by one."""
    t_s, fault = table["t_s"], table["fault"]
    bins, windows = (np.floor(t_s * per_s + 1e-6) for per_s in (RATE_Hz, 1 / WINDOW_S))
    keep = {0}
    for i in range(1, len(table)):
        if bins[i] > bins[i - 1] or (fault[i] != fault[i - 1]).any():
            keep.add(i)
        if windows[i] > windows[i - 1]:
            keep.add(i - 1)
    keep.add(len(table) - 1)
    for window in set(windows):
        inside = [i for i in range(len(table)) if windows[i] == window]
        for column in table.values.T:
            keep |= {max(inside, key=lambda i, of=column: of[i]), min(inside, key=lambda i, of=column: of[i])}
    saturated = [i for i in range(len(table)) if table["allocation_scale"][i] < 1]
    for before, i, behind in zip([None, *saturated], saturated, [*saturated[1:], None], strict=False):
        begins = before is None or t_s[i] - t_s[before] > QUIET_S
        ends = behind is None or windows[behind] > windows[i] or t_s[behind] - t_s[i] > QUIET_S
        if begins or ends:
            keep.add(i)
    return table.values[sorted(keep)]


@pytest.fixture(scope="module")
def long():
    return made(25_300)


@pytest.fixture(scope="module")
def thinned_rows(long):
    return thinned(FirstAndExtremeRows(RATE_Hz), [long])


def test_the_first_rows_of_bins_and_those_that_stand_out_are_kept_and_no_others(long, thinned_rows):
    assert thinned_rows.tobytes() == slowly(long).tobytes()


@given(st.lists(st.integers(1, 25_299), max_size=12))
def test_the_same_rows_however_they_come_in_chunks(long, thinned_rows, places):
    assert (
        thinned(FirstAndExtremeRows(RATE_Hz), chunks(long, set(places))).tobytes() == thinned_rows.tobytes()
    )


def test_a_change_of_columns_ends_a_window():
    others = (*SIGNALS, Signal("sliding_s", "rad/s", 1, "of another law"))
    thinning, before = FirstAndExtremeRows(RATE_Hz), made(4000)
    assert thinning.add(before) == []
    (ended,) = thinning.add(made(2000, others, first=4000))
    (rest,) = thinning.flush()
    assert (ended.signals, rest.signals) == (SIGNALS, others)
    assert ended.values.tobytes() == slowly(before).tobytes()


@pytest.mark.parametrize("rate_Hz", [7.3, 60.0, 100.0, 1000.0])
def test_firsts_are_one_of_each_bin_and_every_row_at_the_rate_of_the_rows(long, rate_Hz):
    t_s = thinned(FirstRows(rate_Hz), chunks(long, range(37, len(long), 37)))[:, 0]
    bins = np.floor(t_s * rate_Hz + 1e-6)
    np.testing.assert_array_equal(bins, np.arange(int(np.floor(25.299 * rate_Hz + 1e-6)) + 1))
    # The first of its bin: the row before it, 1 ms earlier, is of the bin before.
    assert (np.floor((t_s[1:] - 1e-3) * rate_Hz + 1e-6) < bins[1:]).all()


def test_a_rate_that_no_run_has_the_rows_for_is_refused(tmp_path):
    check_rate(1000.0, tmp_path / "run.rrd", 1e-3)
    with pytest.raises(InputError, match="at most 1000 Hz"):
        check_rate(1000.5, tmp_path / "run.rrd", 1e-3)
    with pytest.raises(InputError, match="--record FILE"):
        check_rate(60.0, None, 1e-3)


def test_a_saturation_over_the_edge_of_a_window_begins_once():
    table = made(20_500)
    scale = table["allocation_scale"]
    scale[:] = 1.0
    # Neither row after the edge is the first of a bin; the last one is also the smallest value.
    scale[[19_980, 20_005, 20_010]] = 0.7, 0.7, 0.6
    assert thinned(FirstAndExtremeRows(RATE_Hz), [table]).tobytes() == slowly(table).tobytes()
