"""Rows of a log: two topics with stamps of their own give the log of one table."""

from dataclasses import replace

import numpy as np
import pytest

from spheretwin.machine import Log
from spheretwin.machine.row_order import align_rows, row_order

TIMES = 1e-3 * np.arange(200)
CURRENTS = np.stack([np.sin(20 * TIMES), np.cos(20 * TIMES)], axis=1)
ANGLES = np.stack([TIMES, 2 * TIMES, 3 * TIMES], axis=1)
LOG = Log(TIMES, CURRENTS, ANGLES)


def two_topics(late_s, kind="commanded", order=None):
    """Rows of angles and rows of currents, the latter later."""
    t_s = np.concatenate([TIMES, TIMES + late_s])
    angles, currents = np.full((400, 3), np.nan), np.full((400, 2), np.nan)
    angles[:200], currents[200:] = ANGLES, CURRENTS
    rows = row_order(t_s, angles, currents)[0] if order is None else order
    return Log(t_s[rows], currents[rows], angles[rows], kind)


@pytest.mark.parametrize("late_s", [0.0, 1e-9, 1e-4, 3e-4, 5e-4, 9e-4, -2e-4, 2.3e-3])
@pytest.mark.parametrize("kind", ["commanded", "measured"])
def test_topics_of_any_offset_have_the_rows_of_the_angles(late_s, kind):
    log = align_rows(two_topics(late_s, kind))
    inner = slice(3, 197)
    places = np.searchsorted(log.t_s, TIMES[inner])
    assert log.t_s[places] == pytest.approx(TIMES[inner])
    assert np.array_equal(log.angle_rad[places], ANGLES[inner])
    if late_s == 0.0:
        assert np.array_equal(log.current_A, CURRENTS)
        return
    # Held commands: the mean over the following period; measured ones: about the time of the row.
    fraction = (late_s / 1e-3) % 1
    whole = int(np.floor(late_s / 1e-3))
    rows = np.arange(3, 197) - whole
    held = fraction * CURRENTS[rows - 1] + (1 - fraction) * CURRENTS[rows]
    expected = (
        held
        if kind == "commanded"
        else np.stack([np.sin(20 * (TIMES[inner] - late_s)), np.cos(20 * (TIMES[inner] - late_s))], axis=1)
    )
    assert log.current_A[places] == pytest.approx(expected, abs=1e-9 if kind == "commanded" else 1e-4)
    assert len(log) <= 203
    assert align_rows(log) is log


def test_rows_of_two_topics_in_any_order_are_the_same_log():
    log = align_rows(two_topics(1e-4))
    for order in (np.arange(400), np.random.default_rng(0).permutation(400)):
        other = align_rows(two_topics(1e-4, order=order))
        assert other.digest == log.digest


def test_faster_currents_count_with_their_mean():
    t_s = np.concatenate([TIMES, 2.5e-4 * np.arange(800) + 1e-5])
    angles, currents = np.full((1000, 3), np.nan), np.full((1000, 1), np.nan)
    angles[:200], currents[200:] = ANGLES, np.tile([[0.0], [1.0], [2.0], [3.0]], (200, 1))
    log = align_rows(Log(t_s, currents, angles))
    assert len(log) == 200
    assert log.current_A[1:-1] == pytest.approx(1.5)


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_an_even_table_stays_as_it_is(share):
    """Angles in some rows only: of a slower sensor, or as most of them are late."""
    angles = ANGLES.copy()
    angles[np.random.default_rng(0).random(200) > share] = np.nan
    log = replace(LOG, angle_rad=angles)
    assert align_rows(log) is log


def test_a_table_with_late_angles_stays_as_it_is():
    angles = ANGLES.copy()
    angles[[0, 5, 6, 50, 199]] = np.nan
    log = replace(LOG, angle_rad=angles)
    assert align_rows(log) is log


def test_a_gap_of_the_currents_stays_a_gap():
    log = two_topics(1e-4)
    currents = log.current_A.copy()
    currents[(log.t_s > 0.1) & (log.t_s < 0.12)] = np.nan
    current_A = align_rows(replace(log, current_A=currents)).current_A[:, 0]
    assert np.flatnonzero(np.isnan(current_A)).tolist() == list(range(100, 121))


def test_rows_of_another_topic_are_left_out():
    t_s = np.sort(np.concatenate([TIMES, TIMES + 4e-4]))
    currents, angles = np.full((400, 2), np.nan), np.full((400, 3), np.nan)
    currents[::2], angles[::2] = CURRENTS, ANGLES
    log = align_rows(Log(t_s, currents, angles))
    assert np.array_equal(log.t_s, TIMES)
    assert np.array_equal(log.current_A, CURRENTS)


def test_rows_of_one_time_that_differ_stay():
    rows = np.repeat(np.arange(200), 1 + (np.arange(200) == 7))
    same = Log(TIMES[rows], CURRENTS[rows], ANGLES[rows])
    assert len(align_rows(same)) == 200
    angles = ANGLES[rows].copy()
    angles[8] += 1e-3
    assert len(align_rows(replace(same, angle_rad=angles))) == 201


def test_a_lost_angle_has_a_row_with_its_currents():
    log = two_topics(3e-4)
    lost = np.isin(log.t_s, TIMES[[50, 51, 120]])
    rows = align_rows(Log(log.t_s[~lost], log.current_A[~lost], log.angle_rad[~lost]))
    assert rows.t_s == pytest.approx(TIMES)
    assert np.flatnonzero(np.isnan(rows.angle_rad[:, 0])).tolist() == [50, 51, 120]
    assert rows.current_A == pytest.approx(align_rows(log).current_A)


@pytest.mark.parametrize("counts", [False, True])
def test_angles_of_two_topics_are_at_the_times_of_one(counts):
    t_s = np.concatenate([TIMES, TIMES + 3e-4])
    angles, currents = np.full((400, 3), np.nan), np.full((400, 2), np.nan)
    angles[:200, :2], currents[:200] = ANGLES[:, :2], CURRENTS
    count = np.floor(TIMES / 0.01) if counts else 3 * TIMES  # read 0.3 ms later
    angles[200:, 2] = count
    order = np.argsort(t_s)
    log = align_rows(Log(t_s[order], currents[order], angles[order]))
    assert np.array_equal(log.t_s, TIMES)
    assert np.array_equal(log.angle_rad[:, :2], ANGLES[:, :2])
    expected = count[:-1] if counts else 3 * (TIMES[1:] - 3e-4)  # held if it counts, else interpolated
    assert log.angle_rad[1:, 2] == pytest.approx(expected)


@pytest.mark.parametrize("order", ["swapped", "topics", "chunks", "random"])
def test_messages_out_of_order_are_sorted(order):
    rows = np.arange(200)
    if order == "swapped":
        rows[[20, 21, 90, 95]] = rows[[21, 20, 95, 90]]
    elif order == "chunks":
        rows = np.concatenate([rows[120:], rows[:120]])
    elif order == "random":
        rows = np.random.default_rng(0).permutation(200)
    else:
        log = two_topics(5e-4, order=np.arange(400))
        places, notes = row_order(log.t_s, log.angle_rad, log.current_A)
        assert np.all(np.diff(log.t_s[places]) > 0)
        assert notes == ("rows of two topics sorted by time",)
        return
    places, notes = row_order(TIMES[rows], ANGLES[rows], CURRENTS[rows])
    assert np.array_equal(TIMES[rows][places], TIMES)
    assert "sorted by time" in notes[0]


@pytest.mark.parametrize("back_s", [0.05, 0.0504, 2.0])
def test_a_clock_that_was_set_back_is_not_sorted(back_s):
    t_s = np.where(np.arange(200) < 100, TIMES, TIMES - back_s)
    assert np.array_equal(row_order(t_s, ANGLES, CURRENTS)[0], np.arange(200))
