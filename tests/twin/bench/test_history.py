"""History of a bench: bins with the bounds of all rows, and captures of exactly the rows around an event."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.bench.history import TEMPERATURE, Capture, History, LENGTH_s, RATE_Hz, Trigger
from spheretwin.metrics.effort import CurrentVariation
from spheretwin.models.telemetry.signals import Signal
from tests.twin.bench.cases import GROUPS, done, said, table


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


FAULT = Signal("fault", "1", 2, "failure mode", ("coil.00", "coil.01"))


def captured(trigger, rows, chunk):
    capture = Capture(trigger, GROUPS, 1e-3)
    for first in range(0, len(rows), chunk):
        capture.write(rows.rows(first, min(len(rows), first + chunk)))
    return capture


@pytest.mark.parametrize("chunk", [1, 20, 37, 1000])
@pytest.mark.parametrize(("edge", "event"), [("rising", 412), ("falling", 460)])
def test_a_level_captures_the_rows_around_its_crossing(chunk, edge, event):
    """Above the level from the first row on: only the second time is a crossing."""
    rows = table(0, 1000)
    rows["error_rad"][:30, 1] = rows["error_rad"][412:460, 1] = 0.3
    rows["error_rad"][700:, 1] = 0.4
    level = 0.2 if edge == "rising" else 0.1
    trigger = Trigger("level", "error_rad", 1, level, edge, 0.1, 0.25)
    if edge == "falling":
        rows["error_rad"][:30, 1] = 0.0
        rows["error_rad"][30:412, 1] = 0.3
    capture = captured(trigger, rows, chunk)
    assert (capture.state, capture.t_s) == ("complete", pytest.approx(1e-3 * event))
    np.testing.assert_allclose(capture.read()["t_s"].reshape(-1), 1e-3 * np.arange(event - 100, event + 150))
    np.testing.assert_array_equal(capture.read()["error_rad"], rows["error_rad"][event - 100 : event + 150])


@pytest.mark.parametrize("chunk", [1, 20, 1000])
@pytest.mark.parametrize(("before_s", "length_s", "rows"), [(0.1, 0.2, (0, 140)), (0.0, 0.02, (40, 60))])
def test_an_early_event_has_fewer_rows_before_it_or_none(chunk, before_s, length_s, rows):
    history = table(0, 500)
    history["allocation_scale"][40:60] = 0.7
    capture = captured(Trigger("saturation", before_s=before_s, length_s=length_s), history, chunk)
    np.testing.assert_allclose(capture.read()["t_s"].reshape(-1), 1e-3 * np.arange(*rows))


def test_lost_rank_is_no_saturation():
    rows = table(0, 100)
    rows["allocation_scale"][40:60] = 0.0
    assert captured(Trigger("saturation"), rows, 10).state == "armed"


def test_a_fault_that_begins_triggers_also_when_its_columns_are_new():
    trigger = Trigger("fault", before_s=0.01, length_s=0.03)
    capture = Capture(trigger, GROUPS, 1e-3)
    capture.write(table(0, 20))
    failing = table(20, 60, (FAULT,))
    failing["fault"][7:, 1] = 2.0
    capture.write(failing)
    assert (capture.state, capture.t_s) == ("complete", pytest.approx(0.027))
    present = Capture(trigger, GROUPS, 1e-3)
    failing["fault"][:] = 2.0
    present.write(failing)  # it has begun before
    assert present.state == "armed"


def test_a_bench_captures_every_row_and_arms_again_after_reset(made):
    done(made, "capture", on="level", signal="q_ref_rad", entry=1, level=0.05, before_s=0.02, length_s=0.1)
    made.advance(400)
    assert made.state().capture == "complete"
    rows = made.captured()
    np.testing.assert_allclose(np.diff(rows["t_s"].reshape(-1)), 1e-3, rtol=1e-9)
    assert len(rows["t_s"]) == 100
    np.testing.assert_array_equal(rows["q_ref_rad"][:, 1] > 0.05, np.arange(100) >= 20)
    assert "expected one of t_s" in said(made, "capture", on="level", signal="height")
    done(made, "reset")
    assert (made.state().capture, made.state().capture_t_s, made.captured()) == ("armed", None, {})
    done(made, "capture", on="off")
    assert made.state().capture == "off"
