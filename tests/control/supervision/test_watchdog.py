"""The watchdog alone: what each reason needs, to the tick and to the last bit below it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.control.supervision.watchdog import (
    GO,
    REASONS,
    RELEASE,
    SHORT,
    MeasurementLimits,
    Reason,
    Watchdog,
    WatchdogSection,
    count_rundown,
    fill_watchdog,
    replace_invalid,
    transfer_trip,
    trip,
    watch,
)
from spheretwin.models.base.record import set_states, states_of, transfer_rows

PERIOD_S, NOISE_RAD, QUANTUM_RAD = 1e-3, np.array([3e-4, 3e-4, 0.0]), np.array([8e-5, 8e-5, 3e-3])
RANGE_RAD = np.array([[-1.4, 1.4], [-1.4, 1.4], [-np.inf, np.inf]])
WATCHED = MeasurementLimits(PERIOD_S, NOISE_RAD, QUANTUM_RAD, RANGE_RAD)
STILL = np.zeros(3)


def rows_of(on=True, **section):
    return Watchdog.filled(fill_watchdog, WatchdogSection(on=on, **section), WATCHED)


def made(**section):
    return rows_of(**section)[0]


def looked(watcher, angle, rate=STILL, fresh=(1, 1, 1)):
    watch(watcher, np.array(fresh, float), np.array(angle, float), np.array(rate, float))
    return Reason(int(watcher.reason))


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("missing", [0, 1, 3])
def test_a_jump_is_more_than_the_largest_rate_noise_and_resolution_allow(axis, missing):
    most = 60 * PERIOD_S * (missing + 1) + 6 * np.sqrt(2) * NOISE_RAD[axis] + QUANTUM_RAD[axis]
    for share, reason in ((1 - 1e-9, Reason.NONE), (1 + 1e-9, Reason.JUMP)):
        for sign in (-1, 1):
            watcher, first = made(), np.array([0.9, -0.9, 400.0])
            assert looked(watcher, first) == Reason.NONE  # a first measurement is no jump
            for _ in range(missing):
                looked(watcher, first, fresh=1 - np.eye(3)[axis])
            assert looked(watcher, first + sign * share * most * np.eye(3)[axis]) == reason


@pytest.mark.parametrize("ticks", [1, 5, 8])
def test_stale_is_so_many_ticks_in_a_row(ticks):
    watcher = made(stale_ticks=ticks)
    looked(watcher, STILL)
    for _ in range(3):  # now and then one is missing: nothing happens
        for _ in range(ticks - 1):
            assert looked(watcher, STILL, fresh=(1, 0, 1)) == Reason.NONE
        assert looked(watcher, STILL) == Reason.NONE
    for tick in range(ticks):
        assert looked(watcher, STILL, fresh=(1, 0, 1)) == (Reason.STALE if tick == ticks - 1 else Reason.NONE)


@pytest.mark.parametrize("axis", range(3))
def test_speed_and_edge(axis):
    for rate, reason in ((60.0, Reason.NONE), (np.nextafter(60, 61), Reason.SPEED), (-61.0, Reason.SPEED)):
        assert looked(made(), STILL, rate * np.eye(3)[axis]) == reason
    for angle, reason in ((1.38, Reason.NONE), (1.3801, Reason.EDGE), (-1.3801, Reason.EDGE)):
        assert looked(made(edge_margin_rad=0.02), angle * np.eye(3)[axis]) == (
            reason if axis < 2 else Reason.NONE
        )
    assert looked(made(edge_margin_rad=-0.1), [1.45, 0, 0]) == Reason.NONE  # outside, if that is wanted


@given(st.tuples(*[st.sampled_from([0.1, np.nan, np.inf, -np.inf])] * 6))
def test_a_non_finite_measurement_is_replaced_and_trips(numbers):
    watcher = made()
    looked(watcher, [0.2, 0.3, 0.4])
    measurement = np.array([numbers[:3], numbers[3:], [7.0] * 3])
    lost = ~np.isfinite(measurement[:2]).all(axis=0)
    assert replace_invalid(watcher, measurement)
    assert np.isfinite(measurement).all()
    np.testing.assert_array_equal(measurement[0], np.where(lost, [0.2, 0.3, 0.4], 0.1))
    np.testing.assert_array_equal(measurement[1], np.where(lost, 0.0, 0.1))
    assert watcher.reason == (Reason.MEASUREMENT if lost.any() else Reason.NONE)
    rates = measurement[0] * np.array([1.0, np.inf, np.nan])
    watcher = made()
    watch(watcher, np.ones(3), np.zeros(3), rates)
    assert watcher.reason == Reason.MEASUREMENT
    assert not rates[1:].any()
    assert not replace_invalid(made(on=False), np.full((3, 3), np.nan))


@pytest.mark.parametrize("action", ["release", "short"])
def test_the_first_reason_stays_and_the_run_goes_on_for_its_time(action):
    watcher = made(action=action, rundown_s=0.004)
    assert not count_rundown(watcher)
    trip(watcher, int(Reason.SPEED))
    trip(watcher, int(Reason.EDGE))
    assert REASONS[int(watcher.reason)] == Reason.SPEED
    assert watcher.halt == (SHORT if action == "short" else RELEASE) != GO
    assert [count_rundown(watcher) for _ in range(6)] == [False] * 4 + [True] * 2
    at_once = made(rundown_s=0.0)
    trip(at_once, int(Reason.SPEED))
    assert count_rundown(at_once)


@given(st.lists(st.tuples(st.floats(-1.3, 1.3), st.floats(-50, 50), st.integers(0, 1)), max_size=20))
def test_the_state_is_complete(samples):
    one, other = rows_of(), rows_of()
    for place, (angle, rate, fresh) in enumerate(samples):
        if place == len(samples) // 2:
            set_states(other, states_of(one))
        for each in (one, other) if place >= len(samples) // 2 else (one,):
            looked(each[0], [angle, 0, 0], [rate, 0, 0], [fresh, 1, 1])
            count_rundown(each[0])
    if samples:
        assert states_of(other).tobytes() == states_of(one).tobytes()


def test_a_watchdog_that_was_off_starts_again():
    before, after = rows_of(), rows_of(largest_rate_rad_s=10.0)
    looked(before[0], [0.3, 0, 0])
    transfer_rows(before, after)
    assert looked(after[0], STILL) == Reason.JUMP
    before["on"], after = False, rows_of()
    transfer_rows(before, after)
    assert looked(after[0], [-0.9, 0, 0]) == Reason.NONE


def test_a_trip_stays_when_the_watchdog_is_switched_off():
    before, after = rows_of(), rows_of(on=False)
    looked(before[0], [0, 0, 0], [1e5, 0, 0])
    transfer_rows(before, after)
    transfer_trip(before, after)
    assert (after[0].halt, after[0].reason) == (RELEASE, Reason.SPEED)
